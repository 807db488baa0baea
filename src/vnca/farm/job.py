"""A job: commands that a farm runs, each after those that it waits for."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

from vnca.io.sequence import format_frames

CHUNK = "<chunk>"
"""In the words of a task that paints frames: stands for the frames of a chunk, as 9-16."""


@dataclass(frozen=True)
class Frames:
    """Frames that a farm hands out in chunks.

    Attributes:
        numbers: All of them, in order.
        size: How many are in a chunk.
    """

    numbers: tuple[int, ...]
    size: int

    def __str__(self) -> str:
        return format_frames(self.numbers)

    def chunks(self) -> Iterator[tuple[int, int]]:
        """The first and the last frame of each."""
        for start in range(0, len(self.numbers), self.size):
            chunk = self.numbers[start : start + self.size]
            yield chunk[0], chunk[-1]


@dataclass(frozen=True)
class Task:
    """A command.

    Attributes:
        name: What it is called, unlike any other of its job.
        words: The program and its arguments.
        after: Names of the tasks that have to be done before.
        frames: What stands in the place of `CHUNK`, where a farm hands out chunks of the task.
    """

    name: str
    words: tuple[str, ...]
    after: tuple[str, ...] = ()
    frames: Frames | None = None

    def with_chunk(self, text: str) -> tuple[str, ...]:
        """The words with what a farm writes in the place of `CHUNK`."""
        return tuple(text if word == CHUNK else word for word in self.words)


@dataclass(frozen=True)
class Job:
    """Tasks in an order in which they can be done.

    Attributes:
        title: What it is called.
        tasks: None waits for a later one.
        environment: Variables that all of them are given.
        retries: How often a task that failed is tried again.
    """

    title: str
    tasks: tuple[Task, ...]
    environment: Mapping[str, str] = field(default_factory=dict)
    retries: int = 2

    def given(self, environment: Mapping[str, str], retries: int) -> "Job":
        """The same with other variables, and as many retries."""
        return replace(self, environment=environment, retries=retries)

    def cut(self) -> "Job":
        """The same with a task a chunk, for farms that hand out none themselves."""
        names: dict[str, tuple[str, ...]] = {}
        tasks: list[Task] = []
        for task in self.tasks:
            after = tuple(name for before in task.after for name in names[before])
            parts = [replace(task, after=after)]
            if task.frames is not None:
                chunks = [f"{a}-{b}" for a, b in task.frames.chunks()]
                parts = [Task(f"{task.name} {c}", task.with_chunk(c), after) for c in chunks]
            names[task.name] = tuple(part.name for part in parts)
            tasks += parts
        return replace(self, tasks=tuple(tasks))
