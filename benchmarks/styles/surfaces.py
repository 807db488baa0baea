"""Pictures of surfaces: each is a function of the place."""

import numpy as np
from fields import (
    Field,
    at,
    blurred,
    colour,
    currents,
    filtered,
    frequency,
    light,
    mix,
    noise,
    places,
    ramp,
    slope,
    smooth,
    stirred,
)
from numpy.random import Generator
from strokes import Sheet
from tiling import cells, centred, scattered, squares


def ink(rng: Generator, n: int) -> Field:
    """Black ink that swirls in water, on warm paper."""
    x, y = stirred(rng, n, 0.25, 0.3)
    depth = at(noise(rng, n, 0.2), x, y)
    rings = 1.5 * at(noise(rng, n, 0.28), x, y) + 0.02 * noise(rng, n, 0.08)
    t = rings % 1
    wet = np.exp(-t * np.exp(1.35 + 0.5 * depth)) * smooth(t, 0, 0.03)
    hair = smooth(np.abs((3 * rings + 0.5 * depth) % 1 - 0.5), 0.34, 0.5) * smooth(t, 0.3, 0.5)
    wet = np.clip(1.15 * wet + 0.3 * hair * smooth(depth, -1, 1), 0, 1)
    grain = 0.015 * noise(rng, n, 0.004) + 0.03 * noise(rng, n, 0.1, 0.7)
    paper = ramp(0.5 + 0.2 * noise(rng, n, 0.25), ["f7ead0", "f3dfb8", "ecca98"]) + grain[..., None]
    tint = ramp(0.5 + 0.35 * depth, ["b3452a", "7a5540", "5f6f80", "2f7394"])
    washed = paper * (1 - smooth(wet, 0.0, 0.45)[..., None] * (1 - tint))
    return mix(washed, colour("100e16"), smooth(wet, 0.25, 0.7))


def embers(rng: Generator, n: int) -> Field:
    """A black crust over embers, cracked, with sparks."""
    x, y = places(n)
    x, y = x + 0.010 * noise(rng, n, 0.08, 0.3), y + 0.010 * noise(rng, n, 0.08, 0.3)
    _, wide = cells(scattered(rng, 90, 2), x, y)
    _, narrow = cells(scattered(rng, 420, 1), x, y)
    hot = np.exp(0.3 * noise(rng, n, 0.2))
    heat = 1.1 * np.exp(-((wide / (0.007 * hot)) ** 1.2)) + 0.5 * hot * np.exp(-narrow / 0.0022)
    rough = noise(rng, n, 0.02, 0.8)
    crust = (
        blurred(np.minimum(wide, 0.03) + 0.5 * np.minimum(narrow, 0.01), 0.0015) + 0.0012 * rough
    )
    ash = ramp(0.28 + 0.25 * light(crust, 0.9), ["060508", "17151a", "3d393f", "85807f", "c9c2b8"])
    fire = ["000000", "3a0503", "8e1404", "db3d06", "ff8214", "ffc53d", "fff3b0"]
    picture = ash + ramp(heat * 0.85, fire) + 0.3 * ramp(blurred(heat, 0.012), fire)
    sheet = Sheet(np.zeros((n, n, 3), np.float32))
    for centre in rng.random((220, 2)):
        sheet.disc(centre, 0.0015 + 0.005 * rng.random() ** 3, colour("ffffff"))
    spark = sheet.read()[..., 0]
    picture = mix(picture, colour("fff0b0"), spark)
    return picture + 0.7 * ramp(2.5 * blurred(spark, 0.006), fire)


def marble(rng: Generator, n: int) -> Field:
    """White and grey marble with veins of gold."""
    x, y = stirred(rng, n, 0.3, 0.16)
    cloud = at(noise(rng, n, 0.13, 0.5), x, y)
    colours = ["2f3843", "66707c", "aeb4ba", "e6e3de", "f6f3ec", "fdfcf9"]
    stone = ramp(0.52 + 0.24 * cloud, colours) + 0.012 * noise(rng, n, 0.01, 0.9)[..., None]
    for length, depth in ((0.16, 0.7), (0.08, 0.5)):
        vein = np.abs(at(noise(rng, n, length, 0.2), x, y))
        width = 0.09 * np.exp(0.7 * noise(rng, n, 0.15))
        stone = mix(stone, colour("37404e"), depth * np.exp(-vein / width))
    for length, width in ((0.4, 0.0075), (0.25, 0.003)):
        crack = at(noise(rng, n, length), x, y)
        steep = np.maximum(np.hypot(*slope(crack)), 3)
        across = np.abs(crack) / steep / (width * np.exp(0.55 * noise(rng, n, 0.1)))
        gap = smooth(noise(rng, n, 0.2), -1.6, -1.0)
        share = (1 - smooth(across, 0.85, 1.05)) * smooth(gap, 0.3, 0.6)
        relief = blurred(share, 0.003) + 0.08 * noise(rng, n, 0.012, 0.5) * share
        shine = 0.5 + 0.5 * light(relief, 0.012)
        metal = ramp(shine, ["5a3508", "a8690f", "dba02f", "f8d878", "fff8d8"])
        stone = mix(stone, colour("3a3231"), 0.55 * (1 - smooth(across, 1, 1.9)) * gap)
        stone = mix(stone, metal, share)
    return stone


def stained_glass(rng: Generator, n: int) -> Field:
    """Panes in lead, with light behind."""
    x, y = places(n)
    x, y = x + 0.009 * noise(rng, n, 0.12), y + 0.009 * noise(rng, n, 0.12)
    points = scattered(rng, 130, 3)
    pane, border = cells(points, x, y)
    hues = [
        "8a0f1e",
        "d42a1a",
        "f08c1c",
        "fbd040",
        "3a9f4a",
        "128a86",
        "1a63c4",
        "2f2fa0",
        "8a2f9c",
    ]
    chance = rng.standard_normal((3, len(points)))
    order = 0.5 + 0.28 * at(noise(rng, n, 0.25), *points.T) + 0.13 * chance[0]
    tint = ramp(order % 1, hues)[pane]
    turn = chance[1][pane]
    streak = at(noise(rng, n, 0.04, 0.6), x + 0.5 * turn * y, 0.35 * y + turn)
    glow = smooth(border, 0, 0.04)
    bright = (0.75 + 0.4 * glow) * (1 + 0.13 * streak) * np.exp(0.18 * chance[2])[pane]
    glass = mix(tint * bright[..., None], colour("fff4d0"), 0.42 * glow * smooth(streak, -0.3, 2.4))
    lead = 1 - smooth(border, 0.0085, 0.0105)
    rim = np.clip(1 - (border / 0.0105) ** 2, 0, 1) ** 0.5
    shine = np.clip(light(blurred(rim, 0.0015), 0.008), 0, 1) + 0.05 * noise(rng, n, 0.004)
    metal = ramp(0.15 + 0.85 * shine, ["111216", "2c2f36", "6a707a", "c3c8cf"])
    glass *= (0.45 + 0.55 * smooth(border, 0.009, 0.017))[..., None]
    return mix(glass, metal, lead)


def woodcut(rng: Generator, n: int) -> Field:
    """Carved lines, black on cream, that flow and swell."""
    m = n // 2
    u, v = currents(rng, m, 0.32)
    speed = np.hypot(u, v) + 1e-6
    u, v = u / speed, v / speed
    ring = np.exp(-(((frequency(m) - 27) / 7) ** 2))
    x, y = places(m)
    lines = noise(rng, m, 0.015)
    for _ in range(16):
        for d in (0.008, 0.024):
            lines = at(lines, x + d * u, y + d * v) + at(lines, x - d * u, y - d * v) + lines
        lines = filtered(lines, ring)
        lines = np.tanh(1.5 * lines / lines.std())
    lines = at(blurred(lines, 0.0025), *places(n))
    tone = np.tanh(1.3 * noise(rng, n, 0.13))
    cut = lines + 0.5 * tone + 0.06 * noise(rng, n, 0.006)
    paper = ramp(0.5 + 0.2 * noise(rng, n, 0.1, 0.8), ["e6cf9f", "f2e4c4", "f9f0da"])
    dry = 0.1 * noise(rng, n, 0.003) + 0.05 * noise(rng, n, 0.03)
    inked = smooth(-cut, -0.06, 0.06) * np.clip(0.98 + np.minimum(dry, 0), 0, 1)
    return mix(paper, colour("17120f"), inked)


def watercolour(rng: Generator, n: int) -> Field:
    """Washes over washes, each with the dark rim where it dried."""
    x, y = places(n)
    shape, edge = noise(rng, n, 0.1, 0.2), noise(rng, n, 0.03, 0.5)
    mood = noise(rng, n, 0.3)
    mottle, grain = noise(rng, n, 0.06, 0.6), noise(rng, n, 0.004, 0.5)
    tints = ["1f4fa8", "19809a", "2f9c6a", "e8b520", "e8722a", "d23c4e", "8c3a94"]
    picture = ramp(0.5 + 0.15 * grain, ["f2ecdf", "fbf8f1"])
    pale = [(centre, rng.uniform(0.1, 0.14), 0.45) for centre in scattered(rng, 70)]
    strong = [(centre, rng.uniform(0.04, 0.085), 1.0) for centre in scattered(rng, 120)]
    for centre, radius, strength in pale + strong:
        shift = rng.integers(0, n, 2)
        wobble, blot = np.roll(shape, shift, (0, 1)), np.roll(mottle, shift, (0, 1))
        away = np.hypot((x - centre[0] + 0.5) % 1 - 0.5, (y - centre[1] + 0.5) % 1 - 0.5)
        inside = (radius - away) + 0.015 * wobble + 0.003 * np.roll(edge, shift, (0, 1))
        body = 0.44 + 0.16 * blot + 0.05 * grain + 0.5 * np.exp(-np.maximum(inside, 0) / 0.005)
        share = (
            np.clip(body, 0, 1) * smooth(inside, -0.001, 0.003) * strength * rng.uniform(0.6, 1.1)
        )
        hue = (0.5 + 0.33 * at(mood, *centre[:, None])[0] + 0.08 * rng.standard_normal()) % 1
        other = ramp(hue + 0.09 * blot, tints)
        picture = picture * (1 - np.clip(share, 0, 1)[..., None] * (1 - other))
    return picture


def mosaic(rng: Generator, n: int) -> Field:
    """Small stones in rows that follow the drawing."""
    m = n // 2
    drawing = noise(rng, m, 0.33)
    along_x, along_y = slope(drawing)
    points = scattered(rng, 1000, 3)
    turn = np.zeros(len(points))
    for _ in range(30):
        turn = np.arctan2(at(along_y, *points.T), at(along_x, *points.T))
        some = rng.random((30_000, 2))
        points = centred(points, some, squares(points, turn, some)[0][:, 0])
    x, y = places(n)
    rough = 0.0005 * noise(rng, n, 0.012)
    nearest, far = squares(points, turn, np.stack([x + rough, y + rough], -1).astype(np.float64))
    stone, gap = nearest[..., 0], (far[..., 1] - far[..., 0]).astype(np.float32)
    hues = ["14304f", "1f6e8c", "5cb3a8", "e9dfc0", "e3a93a", "c9562b", "7a1f2b", "14304f"]
    chance = rng.standard_normal((2, len(points)))
    order = 0.62 * at(drawing, *points.T) + 0.028 * chance[0]
    tint = ramp(order % 1, hues) * np.exp(0.16 * chance[1])[:, None]
    face = smooth(gap, 0.001, 0.008)
    shade = 1 + 0.28 * light(blurred(face, 0.001), 0.01) + 0.05 * noise(rng, n, 0.006, 0.6)
    grout = ramp(0.5 + 0.2 * noise(rng, n, 0.004, 0.5), ["3a342f", "6d6358", "948877"])
    return mix(grout, tint[stone] * shade[..., None], smooth(gap, 0.0025, 0.0045))


def rust(rng: Generator, n: int) -> Field:
    """Old paint that flakes from rusted iron, in layers."""
    x, y = places(n)
    x, y = x + 0.006 * noise(rng, n, 0.04, 0.5), y + 0.006 * noise(rng, n, 0.04, 0.5)
    rough, fine = noise(rng, n, 0.05, 0.8), noise(rng, n, 0.006, 0.7)
    iron = ["1e1210", "47200f", "8a3a12", "c2611b", "e5943a", "f3c27a"]
    picture = ramp(0.45 + 0.2 * rough + 0.06 * fine, iron)
    height = 0.0008 * rough + 0.0006 * fine
    paints = (
        (0.1, ["6a3a22", "96562f", "b57442"]),
        (0.0, ["cbb489", "e9dab2", "f5ecd2"]),
        (0.1, ["0f4c52", "1d7d80", "4fb3a6"]),
        (0.75, ["12304a", "1f5570", "3d86a0"]),
    )
    stain = smooth(noise(rng, n, 0.09, 0.6), 0.2, 2.2)
    for bare, tints in paints:
        points = scattered(rng, 500, 1)
        flake, border = cells(points, x, y)
        worn = at(noise(rng, n, 0.13), *points.T) + 0.35 * rng.standard_normal(len(points)) - bare
        kept = (worn > 0).astype(np.float32)[flake]
        crack = 1 - smooth(border, 0.0005, 0.0018) * smooth(worn[flake], 0, 0.3)
        shadow = np.roll(blurred(kept, 0.004), (n // 160, n // 160), (0, 1))
        picture = picture * (1 - 0.5 * shadow * (1 - kept))[..., None]
        paint = ramp(0.5 + 0.2 * np.roll(rough, n // 3, 0) + 0.08 * fine, tints)
        paint = mix(paint, colour("a4501b"), 0.7 * stain)
        picture = mix(picture, paint, kept * (1 - 0.55 * crack))
        height = height + 0.005 * blurred(kept, 0.0012) - 0.001 * kept * crack
    return picture * (1 + 0.55 * light(height, 0.6))[..., None]
