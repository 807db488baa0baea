"""Strokes of a brush or a pen, in fractions of the picture's side."""

from collections.abc import Iterator

import numpy as np
from fields import Field, at
from numpy.typing import ArrayLike
from PIL import Image, ImageDraw


class Sheet:
    """A picture to draw strokes on; what leaves at one side comes in at the other."""

    def __init__(self, ground: Field) -> None:
        self.n = len(ground)
        self._image = Image.fromarray((255 * np.clip(ground, 0, 1)).astype(np.uint8))
        self._draw = ImageDraw.Draw(self._image)

    def read(self) -> Field:
        """What is drawn: [n, n, 3]."""
        return np.asarray(self._image, np.float32) / 255

    def stroke(self, line: Field, width: ArrayLike, tint: Field) -> None:
        """A line of that width, or of those widths; `line` is [points, 2]."""
        along = np.gradient(line, axis=0)
        along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
        side = np.stack([-along[:, 1], along[:, 0]], -1) * np.reshape(width, (-1, 1)) / 2
        self.area(np.concatenate([line + side, (line - side)[::-1]]), tint)

    def disc(self, centre: ArrayLike, radius: float, tint: Field) -> None:
        """A filled circle."""
        angle = np.linspace(0, 2 * np.pi, 32, endpoint=False)
        self.area(np.asarray(centre) + radius * np.stack([np.cos(angle), np.sin(angle)], -1), tint)

    def area(self, outline: Field, tint: Field) -> None:
        """A filled polygon, [corners, 2]."""
        fill = tuple(int(255 * c) for c in np.clip(tint, 0, 1))
        for shift in _copies(outline):
            corners = (outline + shift) * self.n
            self._draw.polygon([tuple(corner) for corner in corners], fill=fill)


def _copies(outline: Field) -> Iterator[tuple[int, int]]:
    """By how many sides the outline is moved to be seen."""
    low, high = np.floor(outline.min(0)).astype(int), np.floor(outline.max(0)).astype(int)
    return ((-i, -j) for i in range(low[0], high[0] + 1) for j in range(low[1], high[1] + 1))


def path(u: Field, v: Field, start: Field, length: float, step: float = 0.006) -> Field:
    """Lines from `start` [lines, 2] on through the flow's directions: [lines, points, 2]."""
    line = [start]
    for _ in range(max(2, round(length / step))):
        x, y = line[-1].T
        way = np.stack([at(u, x, y), at(v, x, y)], -1)
        way /= np.maximum(np.linalg.norm(way, axis=-1, keepdims=True), 1e-9)
        line.append(line[-1] + step * way)
    return np.stack(line, 1)
