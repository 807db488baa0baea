"""Takes steps with less and less memory left, and says each time whether it was there."""

import resource

import numpy as np

from vnca.engine import native
from vnca.engine.automaton import stencil

CELLS, CHANNELS, HIDDEN, THREADS = 60_000, 12, 16, 4


def main() -> None:
    random = np.random.default_rng(0)
    state = random.standard_normal((CELLS + 1, CHANNELS), np.float32)
    arrays = (
        # Neighbours far away: what they add to the gradient takes most of the memory.
        random.integers(0, CELLS + 1, (27, CELLS), dtype=np.int32),
        np.zeros((CELLS, 0), np.float32),
        random.standard_normal((HIDDEN, 5 * CHANNELS), np.float32),
        np.zeros(HIDDEN, np.float32),
        random.standard_normal((CHANNELS, HIDDEN), np.float32),
        stencil(),
        state,
    )
    native.backward(state, np.arange(8, dtype=np.int32), *arrays, threads=THREADS)
    rows = np.arange(CELLS, dtype=np.int32)
    for megabytes in range(160, -1, -8):
        with open("/proc/self/statm") as file:
            used = int(file.read().split()[0]) * resource.getpagesize()
        resource.setrlimit(resource.RLIMIT_AS, (used + (megabytes << 20), resource.RLIM_INFINITY))
        try:
            native.backward(state, rows, *arrays, threads=THREADS)
            print("there")
        except MemoryError:
            print("not there")
        finally:
            resource.setrlimit(resource.RLIMIT_AS, (resource.RLIM_INFINITY,) * 2)


if __name__ == "__main__":
    main()
