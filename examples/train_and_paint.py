"""Simulate smoke, learn a painting on one frame of it, paint all frames, film and measure them.

    python examples/train_and_paint.py [OUT [ITERATIONS]]

With the draft's 250 iterations it takes minutes on two cores.
"""

import sys
from importlib.resources import as_file, files
from pathlib import Path

import vnca


class Progress:
    """Prints how far long work has come."""

    def progress(self, what: str, done: int, total: int, unit: str, note: str = "") -> None:
        """Print it, on one line."""
        print(f"\r{what} {done}/{total} {unit} {note}", end="\n" if done == total else "")

    def note(self, line: str) -> None:
        """Print what the user should know."""
        print(line)

    def made(self, what: str, path: Path) -> None:
        """Print where a result is."""
        print(f"{what}: {path}")


def main(out: str = "example", iterations: str = "250") -> None:
    """Do it all, in a folder."""
    folder, watch = Path(out), Progress()
    for _ in vnca.simulate("plume", out=folder / "smoke", resolution=32, frames=24, watch=watch):
        pass
    with as_file(files("vnca.data") / "vangogh_cafe_terrace.webp") as picture:
        model = vnca.train(
            folder / "smoke" / "plume_0018.vdb",
            picture,
            out=folder / "run",
            overwrite=True,
            iterations=int(iterations),
            watch=watch,
        )
        painting = vnca.stylize(
            model,
            folder / "smoke",
            out=folder / "painted",
            overwrite=True,
            frames="12-24",
            watch=watch,
        )
        for frame in painting:
            print(f"frame {frame.number}: {frame.path}")
        vnca.render(folder / "painted", folder / "painted.gif", film={"fps": 12}, watch=watch)
        print(vnca.evaluate(model, folder / "smoke", frames="20-24", watch=watch))


if __name__ == "__main__":
    main(*sys.argv[1:])
