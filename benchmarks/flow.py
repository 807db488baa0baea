"""How well optical flow is estimated, on motion that is known.

Run `python benchmarks/flow.py`. The textures are of kinds that the network was never trained on
(spot noise of Gabor kernels, Worley's cells, a painting); 30 % of their variance may be replaced
between the pictures. `full` pictures hold texture everywhere, in `masked` ones it moves inside a
silhouette that stays, and in `smoke` ones a solid texture is carried through a frame of smoke and
rendered. There the truth is the projected velocity, which no estimator can reach: what moves at
different depths overlaps.

Errors are means over pixels with texture. `--reference` adds the published weights of the
two-stream dynamics network (not part of this project), times the one factor that fits plain
translations best.
"""

import argparse
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from functools import cache
from itertools import product
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Generator, Tensor
from torch.nn import functional

import vnca
from msoe import published
from vnca.bench import append_csv, run_facts, write_json
from vnca.core.camera import frame_box
from vnca.core.errors import VncaError
from vnca.features.flow import FlowNetwork
from vnca.io import SmokeFormat, read_smoke
from vnca.io.picture import read_image
from vnca.metrics.motion import Estimator, dis, estimator_of, farneback
from vnca.rendering.colour import linear_to_srgb, srgb_to_linear
from vnca.rendering.march import sample
from vnca.rendering.view import projected_velocity, render
from vnca.training.config import SmokeConfig
from vnca.training.scenes.smoke import smoke_bounds
from vnca.training.trainers import choose_scales

sys.path.append(str(Path(__file__).parents[1] / "tools" / "flow"))
from displacement import random_displacement
from pairs import moving_texture, random_silhouette
from textures import KINDS, Kind, bank, cut, log_uniform, uniform

PICTURES = ("full", "masked", "smoke")
SPEEDS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Root mean square over a picture, pixels."""
REPLACED = (0.0, 0.3)
SIDE, TEXTURE_SIDE, CONTRAST = 128, 192, 0.18
SEED = 20260101
PAINTING = Path(vnca.__file__).parent / "data" / "vangogh_cafe_terrace.webp"
PLUME = Path(__file__).parents[1] / "tests" / "data" / "plume_sphere_0030.vdb"


@dataclass(frozen=True)
class Pair:
    """Two pictures, the motion between them, and the pixels in which it counts."""

    before: Tensor
    after: Tensor
    flow: Tensor
    where: Tensor


def spots(count: int, side: int, random: Generator) -> Tensor:
    """Gabor noise: a few hundred small waves, scattered and added up."""
    at = torch.arange(side, device=random.device)
    picture = torch.zeros(count, side, side, device=random.device)
    wavelength, width = log_uniform(count, 5, 20, random), log_uniform(count, 4, 12, random)
    angle, spread = uniform(count, 0, pi, random), uniform(count, 0.3, pi, random)
    for _ in range(400):
        right = at - uniform(count, 0, side, random)
        down = at[:, None] - uniform(count, 0, side, random)
        turned = angle + spread * uniform(count, -0.5, 0.5, random)
        wave = torch.cos(2 * pi * (right * turned.cos() + down * turned.sin()) / wavelength)
        sign = uniform(count, -1, 1, random)
        picture += sign * wave * torch.exp(-(right**2 + down**2) / (2 * width**2))
    return picture


def worley(count: int, side: int, random: Generator) -> Tensor:
    """How much further the second nearest of scattered points is than the nearest."""
    along = torch.arange(side, dtype=torch.float32)
    at = torch.stack(torch.meshgrid(along, along, indexing="xy"), dim=-1).view(-1, 2)
    pictures: list[Tensor] = []
    for _ in range(count):
        points = side * torch.rand(int(log_uniform(1, 60, 600, random)), 2, generator=random)
        near = torch.cdist(at, points).topk(2, largest=False).values
        pictures.append((near[:, 1] - near[:, 0]).view(side, side))
    return torch.stack(pictures)


def painting(count: int, side: int, random: Generator) -> Tensor:
    """Parts of the picture that comes with the package."""
    linear = torch.from_numpy(read_image(PAINTING))
    grey = linear_to_srgb(linear).mean(dim=-1)
    return torch.stack([cut(grey, side, random) for _ in range(count)])


def textured(speed: float, replaced: float, count: int, *, masked: bool) -> Iterator[Pair]:
    """Texture that moves over the whole picture, or within a silhouette that stays."""
    random = Generator().manual_seed(SEED + round(1000 * speed))
    for kind in (spots, worley, painting):
        flow = random_displacement(torch.full((count, 1, 1), speed), SIDE, random)
        share = torch.full((count, 1, 1), replaced)
        before, after = moving_texture(held_out(kind), flow, share, random)
        silhouette = random_silhouette(count, SIDE, random)
        for i in range(count):
            seen = silhouette[i] if masked else torch.ones(SIDE, SIDE)
            shown = [(seen * (0.5 + CONTRAST * t[i])).clamp(0, 1) for t in (before, after)]
            yield Pair(shown[0], shown[1], flow[i], seen > 0.5)


@cache
def held_out(kind: Kind) -> Tensor:
    return bank({kind: 1}, 12, TEXTURE_SIDE, Generator().manual_seed(SEED))


def carried(speed: float, replaced: float, count: int) -> Iterator[Pair]:
    """A solid texture carried through one frame of smoke, `count` times from three sides."""
    random = Generator().manual_seed(SEED + round(1000 * speed))
    density, velocity, gamma = plume()
    at = torch.stack(torch.meshgrid(*map(torch.arange, density.shape), indexing="ij"), dim=-1)
    points = at[density > 0].float()
    for index in range(3 * count):
        camera = frame_box(
            (-0.5,) * 3, [n - 0.5 for n in density.shape], 120.0 * index + 20, elevation=10
        )
        size = {"rows": SIDE, "columns": SIDE, "gamma": gamma}
        flow, opacity = projected_velocity(density, velocity, camera, **size)
        inside = opacity > 0.6
        faster = speed / flow[inside].square().sum(dim=-1).mean().sqrt()
        back = torch.zeros_like(points)
        for _ in range(6):
            back = -faster * sample(velocity, points + back)
        old, new = solid_texture(random), solid_texture(random)
        after = (1 - replaced) ** 0.5 * old(points + back) + replaced**0.5 * new(points)
        shown: list[Tensor] = []
        for texture in (old(points), after):
            colour = torch.zeros(*density.shape, 3)
            grey = srgb_to_linear((0.5 + CONTRAST * texture).clamp(0, 1))
            colour[density > 0] = grey[:, None].expand(-1, 3)
            view = render(density, colour, camera, **size)
            shown.append(linear_to_srgb(view.colour.mean(dim=-1)))
        flow = faster * flow.permute(2, 0, 1)
        yield Pair(shown[0], shown[1], flow, inside & (flow.norm(dim=0) > 0.25 * speed))


@cache
def plume() -> tuple[Tensor, Tensor, float]:
    """Density in units of its scale, velocity in cells a frame, and the extinction of one."""
    caches = SmokeFormat(velocity_units="mantaflow", time_scale=0.4)
    smoke = read_smoke(PLUME, caches)
    scales = choose_scales(smoke, SmokeConfig())
    box = smoke_bounds(smoke, scales.density)
    inside = box.slices(smoke.box)
    assert smoke.velocity is not None
    density = torch.from_numpy(smoke.density[inside] / scales.density).float()
    return density, torch.from_numpy(smoke.velocity[inside]).float(), scales.gamma


def solid_texture(random: Generator) -> Callable[[Tensor], Tensor]:
    """Eighty waves of 3 to 8 cells in all directions, of unit variance."""
    direction = functional.normalize(torch.randn(80, 3, generator=random), dim=1)
    wave = direction * 2 * pi / log_uniform(80, 3, 8, random).view(-1, 1)
    phase = 2 * pi * torch.rand(80, generator=random)
    return lambda points: torch.cos(points @ wave.T + phase).sum(dim=1) / 40**0.5


def errors(estimator: Estimator, pairs: list[Pair]) -> tuple[float, float]:
    """Mean endpoint error in pixels, and mean cosine distance."""
    ends: list[Tensor] = []
    turns: list[Tensor] = []
    for pair in pairs:
        found = torch.from_numpy(estimator(pair.before.numpy(), pair.after.numpy()))
        found, true = found.permute(2, 0, 1)[:, pair.where], pair.flow[:, pair.where]
        ends.append((found - true).norm(dim=0).mean())
        turns.append(1 - functional.cosine_similarity(found, true, dim=0, eps=1e-6).mean())
    return torch.stack(ends).mean().item(), torch.stack(turns).mean().item()


def fitted(estimator: Estimator) -> tuple[Estimator, float]:
    """The estimator times the factor that fits plain translations of all speeds best."""
    random = Generator().manual_seed(SEED)
    count = 4 * len(SPEEDS)
    speed = torch.tensor(SPEEDS).repeat_interleave(4).view(-1, 1, 1)
    flow = random_displacement(speed, SIDE, random, uneven=0.0)
    pairs = moving_texture(bank(KINDS, 64, TEXTURE_SIDE, random), flow, 0 * speed, random)
    above = below = 0.0
    for i in range(count):
        shown = [(0.5 + CONTRAST * texture[i]).clamp(0, 1).numpy() for texture in pairs]
        found = torch.from_numpy(estimator(shown[0], shown[1])).permute(2, 0, 1) / speed[i]
        above += (found * flow[i] / speed[i]).sum().item()
        below += found.square().sum().item()
    factor = above / below
    return lambda before, after: np.float32(factor) * estimator(before, after), factor


def positive(text: str) -> int:
    if int(text) < 1:
        raise ValueError
    return int(text)


def main() -> None:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--reference", type=Path, metavar="FILE", help="the published weights")
    parser.add_argument("--weights", type=Path, metavar="FILE", help="instead of those shipped")
    parser.add_argument("--pairs", type=positive, default=4, help="of each kind, for each figure")
    parser.add_argument("--threads", type=positive, default=2)
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the rows here")
    parser.add_argument("--csv", type=Path, metavar="FILE", help="append the rows to this")
    options = parser.parse_args()
    torch.set_num_threads(options.threads)
    facts = run_facts("cpu", options.threads)
    print("{device}, {threads} threads, torch {torch}, vnca {vnca}".format(**facts))
    try:
        network = FlowNetwork.read(options.weights) if options.weights else FlowNetwork.load()
        estimators = {"ours": estimator_of(network.eval())}
        if options.reference:
            estimators["published"], factor = fitted(published(options.reference))
            print(f"published weights: scaled by {factor:.3f}, which fits plain translations best")
        else:
            print("published weights: left out, give --reference to compare with them")
        estimators |= {"dis": dis(), "farneback": farneback()}
    except VncaError as error:
        parser.error(str(error))
    print(f"forward and backward at 96×96: {time_of(network):.3f} s\n")
    rows = list(measure(estimators, options.pairs))

    if options.json is not None:
        write_json(options.json, facts, rows)
    if options.csv is not None:
        append_csv(options.csv, facts, rows)


def measure(estimators: Mapping[str, Estimator], count: int) -> Iterator[dict[str, Any]]:
    """Rows of the table, each printed as soon as it is known."""
    print("endpoint error, pixels, and cosine distance")
    print(f"pictures  replaced  speed  {''.join(f'{name:<18}' for name in estimators)}".rstrip())
    for pictures, replaced, speed in product(PICTURES, REPLACED, SPEEDS):
        if pictures == "smoke":
            pairs = list(carried(speed, replaced, count))
        else:
            pairs = list(textured(speed, replaced, count, masked=pictures == "masked"))
        line = f"{pictures:<9} {replaced:>8.0%} {speed:>6}  "
        for name, estimator in estimators.items():
            end, turn = errors(estimator, pairs)
            line += f"{end:<7.3f}{turn:<11.4f}"
            yield {
                "estimator": name,
                "pictures": pictures,
                "replaced": replaced,
                "speed": speed,
                "endpoint_error": round(end, 4),
                "cosine_distance": round(turn, 5),
            }
        print(line.rstrip(), flush=True)


def time_of(network: FlowNetwork) -> float:
    """Seconds of one estimate and its gradient at 96×96, the best of five."""
    network.requires_grad_(False)
    pair = torch.rand(2, 1, 96, 96, generator=Generator().manual_seed(0)).requires_grad_()
    taken: list[float] = []
    for _ in range(5):
        start = time.perf_counter()
        network(pair[0], pair[1]).square().sum().backward()
        taken.append(time.perf_counter() - start)
    return min(taken)


if __name__ == "__main__":
    main()
