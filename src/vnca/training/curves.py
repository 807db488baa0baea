"""Loss curves and previews as TensorBoard reads them."""

import os
import socket
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from vnca.core.errors import OutputError

PATTERN = "events.out.tfevents.*"
"""What TensorBoard calls a file of curves."""


class Curves:
    """An event file, written point by point.

    TensorBoard's own writer has a thread that writes every two minutes: that much is lost when the
    program is killed, and a full disk ends in a traceback.
    """

    def __init__(self, folder: Path, *, after: int = 0) -> None:
        """Begin a file in a folder; of earlier files only the points up to iteration `after` count.

        Raises:
            OutputError: If it cannot be written.
        """
        from tensorboard.summary.writer.record_writer import RecordWriter

        # TensorBoard reads them in the order of their names: this one has to be the last.
        earlier = [path.name.split(".")[3] for path in folder.glob(PATTERN)]
        begun = max(int(time.time()), *(int(at) + 1 for at in earlier if at.isdecimal()), 0)
        name = f"{begun:010}.{socket.gethostname()}.{os.getpid()}.0"
        self._path = folder / PATTERN.replace("*", name)
        with self._told():
            self._records = RecordWriter(self._path.open("xb"))
        self._write(0, file_version="brain.Event:2")
        self._write(after + 1, session_log={"status": "START"})

    def add(self, iteration: int, values: Mapping[str, float]) -> None:
        """A point on each of some curves.

        Raises:
            OutputError: If it cannot be written.
        """
        self._write_summary(
            iteration, [{"tag": tag, "simple_value": value} for tag, value in values.items()]
        )

    def show(self, iteration: int, tag: str, png: bytes, rows: int, columns: int) -> None:
        """A picture in RGB, as a PNG file has it.

        Raises:
            OutputError: If it cannot be written.
        """
        image = {
            "height": rows,
            "width": columns,
            "colorspace": 3,
            "encoded_image_string": png,
        }
        self._write_summary(iteration, [{"tag": tag, "image": image}])

    def close(self) -> None:
        """End the file."""
        with suppress(OSError):  # What could not be written has been told.
            self._records.close()

    def _write_summary(self, iteration: int, values: list[dict[str, Any]]) -> None:
        self._write(iteration, summary={"value": values})

    def _write(self, iteration: int, **content: Any) -> None:
        from tensorboard.compat.proto.event_pb2 import (
            Event,  # pyright: ignore[reportAttributeAccessIssue]
        )

        event = Event(step=iteration, wall_time=time.time(), **content)
        with self._told():
            self._records.write(event.SerializeToString())
            self._records.flush()

    @contextmanager
    def _told(self) -> Iterator[None]:
        try:
            yield
        except OSError as error:
            raise OutputError(f"{self._path}: cannot be written ({error.strerror})") from error
