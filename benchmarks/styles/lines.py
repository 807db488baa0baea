"""Pictures of lines, drawn one over the other."""

from itertools import pairwise

import numpy as np
from fields import (
    Field,
    at,
    blurred,
    colour,
    currents,
    mix,
    noise,
    places,
    ramp,
    smooth,
)
from numpy.random import Generator
from strokes import Sheet, path
from tiling import scattered


def threads(rng: Generator, n: int) -> Field:
    """Pale threads, each one long curve, over others that lie deeper in green."""
    ground = ramp(0.5 + 0.25 * noise(rng, n, 0.15, 0.4), ["04161a", "072a2b", "0c4038", "0f5546"])
    sheet = Sheet(ground)
    layers = (
        (90, 0.012, ["0b3f3d", "126057", "0f6f7a"]),
        (60, 0.010, ["1d8a78", "2fa58a", "2d8fa3"]),
        (55, 0.009, ["9fd8c0", "d9f0da", "f6efcf", "e9c983"]),
    )
    for count, width, tints in layers:
        u, v = currents(rng, n, 0.28)
        for line in path(u, v, scattered(rng, count), 1.1):
            taper = np.minimum(1, 12 * (0.5 - np.abs(np.linspace(-0.5, 0.5, len(line)))))
            tint = ramp(rng.random(), tints)
            sheet.stroke(line + 0.004, 1.5 * width * taper, colour("03110f"))
            sheet.stroke(line, width * taper, 0.62 * tint)
            sheet.stroke(line - 0.001, 0.7 * width * taper, tint)
    return sheet.read()


def engraving(rng: Generator, n: int) -> Field:
    """Level lines of ink on paper, which wave, swell and end."""
    rows = 24
    x, y = places(n)
    down = rows * (y + 0.011 * noise(rng, n, 0.25) + 0.001 * noise(rng, n, 0.06))
    row = np.floor(down)
    tone = 0.44 + 0.13 * noise(rng, n, 0.16)
    # Each line swells by itself: its neighbours take it from far away.
    hand = at(noise(rng, n, 0.09), x, 7 * row / rows)
    width = tone + 0.11 * hand
    grain = 0.05 * noise(rng, n, 0.004)
    away = np.abs(down - row - 0.5)
    ink = smooth(width / 2 - away, -0.04, 0.04) * smooth(width, 0.1, 0.2)
    paper = ramp(0.5 + 0.2 * noise(rng, n, 0.1, 0.8), ["dcd2bd", "ece4d2", "f6f1e4"])
    dark = ramp(0.5 + 0.25 * noise(rng, n, 0.12), ["0d1726", "1c2433", "33262a"])
    return mix(paper, dark, np.clip(ink * (0.97 + np.minimum(grain, 0)), 0, 1))


def fur(rng: Generator, n: int) -> Field:
    """Tawny hair in locks, striped."""
    m = n // 2
    angle = 1.5 + 0.22 * noise(rng, m, 0.22)
    stripes = np.sin(9 * noise(rng, m, 0.5) + 1.2 * noise(rng, m, 0.12))
    u, v = np.cos(angle), np.sin(angle)
    coat = ["160d0a", "4a2713", "9a5420", "d0873a", "ecbf77", "fbeccb"]
    sheet = Sheet(np.broadcast_to(colour("1c100b"), (n, n, 3)))
    locks = scattered(rng, 2600, 2)
    tone = 0.54 + 0.34 * at(stripes, *locks.T) + 0.09 * rng.standard_normal(len(locks))
    lines = path(u, v, locks, 0.11)
    order = rng.permutation(len(locks))
    for layer in np.array_split(order, 3):
        for lock in layer:
            line = lines[lock]
            taper = np.sin(np.pi * np.linspace(0.12, 1, len(line)) ** 0.8)
            side = np.stack([-np.gradient(line[:, 1]), np.gradient(line[:, 0])], -1) / 0.006
            sheet.stroke(line, 0.017 * taper, ramp(tone[lock] - 0.32, coat))
            for _ in range(7):
                spread = rng.uniform(-0.0075, 0.0075) * taper[:, None]
                hair = line + side * spread + rng.normal(0, 0.002, 2)
                tint = ramp(tone[lock] + rng.normal(0, 0.1), coat)
                sheet.stroke(hair, rng.uniform(0.0012, 0.0032) * taper, tint)
    return sheet.read()


def frost(rng: Generator, n: int) -> Field:
    """Feathers of ice on deep blue."""
    deep = ["030b24", "08204f", "0e3c7c", "1c63a6"]
    picture = ramp(0.45 + 0.22 * noise(rng, n, 0.1, 0.4), deep)

    def feather(sheet: Sheet, start: Field, angle: float, length: float, order: int) -> None:
        """A curved stem, and others along it."""
        count = max(4, round(length / (0.011, 0.0075, 0.01)[order]))
        bend = rng.normal(0, 0.5 if order else 0.9)
        way = angle + bend * np.linspace(0, 1, count)
        steps = np.stack([np.cos(way), np.sin(way)], -1) * length / count
        line = start + np.cumsum(steps, 0)
        width = (0.0075, 0.0036, 0.0019)[order]
        tint = np.full(3, rng.uniform(0.75, 1), np.float32)
        for i in range(count) if order < 2 else ():
            along = i / count
            reach = length * (0.42, 0.24)[order] * min(1, 0.3 + 4 * along) * (1 - along) ** 0.7
            reach *= rng.uniform(0.75, 1.1)
            for side in (-1, 1):
                lean = side * rng.normal(0.95, 0.06)
                if reach > 0.006:
                    feather(sheet, line[i], way[i] + lean, reach, order + 1)
        taper = np.interp(np.linspace(0, 1, count), [0, 0.15, 1], [0.3, 1, 0.3])
        sheet.stroke(line, width * taper, tint)

    layers = ((36, 0.34, "1d529c"), (32, 0.3, "4f97da"), (36, 0.27, "eef9ff"))
    for count, length, tint in layers:
        sheet = Sheet(np.zeros((n, n, 3), np.float32))
        for start in scattered(rng, count):
            feather(sheet, start, rng.uniform(0, 2 * np.pi), length * rng.uniform(0.7, 1.1), 0)
        ice = sheet.read()[..., 0]
        near = blurred(ice, 0.012)
        picture = picture * (1 - 0.3 * near)[..., None] + 0.16 * near[..., None] * colour("5fa8ff")
        picture = mix(picture, colour(tint), 0.9 * ice)
    return picture


def circuit(rng: Generator, n: int) -> Field:
    """Copper traces and pads on a green board, with chips."""
    grid, side = 40, 1 / 40
    board = ramp(0.5 + 0.2 * noise(rng, n, 0.15, 0.5), ["05281c", "0a4a2e", "127042"])
    taken = np.zeros((grid, grid), bool)
    ways = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)]
    chips = scattered(rng, 7)
    chips = np.round(chips * grid).astype(int)
    for i, j in chips:
        taken[np.ix_(np.arange(i - 2, i + 3) % grid, np.arange(j - 1, j + 2) % grid)] = True
    traces, crossed = [], set()
    for _ in range(6000):
        here, way = rng.integers(0, grid, 2), int(rng.integers(8))
        if taken[tuple(here % grid)]:
            continue
        line = [here]
        taken[tuple(here % grid)] = True
        while len(line) < 26:
            turns = (0, 1, -1) if rng.random() > 0.12 else (1, -1, 0)
            for turn in turns:
                step = np.array(ways[(way + turn) % 8])
                there = here + step
                # Doubled, so that it is whole: two diagonals must not cross there.
                middle = tuple((2 * here + step) % (2 * grid))
                if not taken[tuple(there % grid)] and middle not in crossed:
                    break
            else:
                break
            way, here = (way + turn) % 8, there
            taken[tuple(here % grid)] = True
            crossed.add(middle)
            line.append(here)
        if len(line) < 4:
            taken[tuple(np.transpose(line) % grid)] = False
            continue
        traces.append(np.array(line, float) * side)
    sheet = Sheet(board)
    for shadow in (True, False):
        for trace in traces:
            away = 0.0035 if shadow else 0
            tints = ["8f4a1c", "c8772e", "e9a95a"]
            tint = colour("031a12") if shadow else ramp(rng.uniform(0.2, 0.9), tints)
            for ends in pairwise(trace):
                sheet.stroke(np.stack(ends) + away, 0.0105, tint)
            for joint in trace:
                sheet.disc(joint + away, 0.0052, tint)
            for end in (trace[0], trace[-1]):
                sheet.disc(end + away, 0.0112, tint)
            if not shadow:
                for end in (trace[0], trace[-1]):
                    sheet.disc(end, 0.009, colour("f7dc9a"))
                    sheet.disc(end, 0.0045, colour("120d0b"))
    for chip in chips * side:
        for row in (-1, 1):
            for pin in np.arange(-2, 3) * side * 0.95:
                foot = chip + np.array([[pin, 0], [pin, 0.046 * row]])
                sheet.stroke(foot, 0.009, colour("e3e6e8"))
        flat = np.array([[-0.062, 0], [0.062, 0]])
        sheet.stroke(chip + flat + 0.004, 0.064, colour("02110b"))
        sheet.stroke(chip + flat, 0.062, colour("3c4046"))
        sheet.stroke(chip + 0.95 * flat, 0.055, colour("15171b"))
        sheet.disc(chip + np.array([-0.047, 0.014]), 0.006, colour("e8eaec"))
    return sheet.read() * (1 + 0.05 * noise(rng, n, 0.006, 0.5))[..., None]
