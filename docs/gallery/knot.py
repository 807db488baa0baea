"""Makes a mesh to put textures on: a trefoil knot, tied from a tube.

python docs/gallery/knot.py knot.obj
"""

import sys
from pathlib import Path

import numpy as np

ALONG, AROUND, RADIUS = 240, 32, 0.55


def main(out: str) -> None:
    """Write the knot as OBJ, up +y."""
    angle = np.linspace(0, 2 * np.pi, ALONG, endpoint=False)
    middle = np.stack(
        [
            np.sin(angle) + 2 * np.sin(2 * angle),
            np.cos(angle) - 2 * np.cos(2 * angle),
            -np.sin(3 * angle),
        ],
        axis=1,
    )
    forward = np.roll(middle, -1, 0) - np.roll(middle, 1, 0)
    side = np.cross(forward, middle)
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(side, forward)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    turn = np.linspace(0, 2 * np.pi, AROUND, endpoint=False)[:, None]
    ring = np.cos(turn) * side[:, None] + np.sin(turn) * up[:, None]
    points = (middle[:, None] + RADIUS * ring).reshape(-1, 3)
    i, j = np.meshgrid(np.arange(ALONG), np.arange(AROUND), indexing="ij")
    here, there = i * AROUND, (i + 1) % ALONG * AROUND
    after = (j + 1) % AROUND
    quads = np.stack([here + j, here + after, there + after, there + j], -1).reshape(-1, 4) + 1
    lines = [f"v {x:.5f} {y:.5f} {z:.5f}" for x, y, z in points]
    lines += ["f " + " ".join(map(str, quad)) for quad in quads]
    Path(out).write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main(sys.argv[1])
