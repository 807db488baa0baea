"""The frozen network that tells how a texture moves between two pictures.

Motion is seen as energy: filters over the pair, squared, answer to a pattern that moves with one
velocity, whatever its phase (Adelson and Bergen 1985). Divided by their sum they do not depend on
contrast, and they hold up when part of the texture is replaced between the pictures, where
matching brightness does not. It is the architecture of the two-stream texture network (Tesfaldet
et al. 2018) with one set of weights for all scales and a coarse-to-fine decoder: each scale sees
the second picture moved back by what the coarser ones found, and adds the rest.
"""

from importlib import resources
from math import cos, pi, sin
from pathlib import Path

import torch
from jaxtyping import Float
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor, nn
from torch.nn import functional

from vnca.core.errors import FileFormatError, ShapeError
from vnca.core.files import existing_file, whole_file

SMALLEST = 32
"""Rows and columns a picture must have."""

_FORMAT = "vnca-flow-1"
_COARSEST = 12
_ENERGIES, _WIDTH, _HIDDEN, _KERNEL = 64, 64, 48, 10
_STILL = 1e-3
"""Energy (of a picture of unit contrast) below which there is nothing to see."""


class FlowNetwork(nn.Module):
    """Optical flow of a pair of pictures; see the module.

    `load` gives the trained and frozen network, the constructor an untrained one.
    """

    def __init__(self) -> None:
        super().__init__()
        self.filters = nn.Conv2d(2, _ENERGIES, _KERNEL, stride=2, bias=False)
        self.filters.weight.data = _moving_gratings()
        self.first = nn.Conv2d(_ENERGIES + 1 + _HIDDEN + 2, _WIDTH, 3, padding=1)
        self.second = nn.Conv2d(_WIDTH, _HIDDEN, 3, padding=1)
        self.rest = nn.Conv2d(_HIDDEN, 2, 3, padding=1)
        nn.init.zeros_(self.rest.weight)

    @classmethod
    def load(cls, device: torch.device | str = "cpu") -> "FlowNetwork":
        """The trained network that is shipped with the package, frozen.

        Raises:
            FileFormatError: If its file is missing or damaged.
        """
        with resources.as_file(resources.files("vnca.data") / "flow.safetensors") as path:
            return cls.read(path).to(device).requires_grad_(False).eval()

    @classmethod
    def read(cls, path: Path) -> "FlowNetwork":
        """A network written by `write`, on the CPU.

        Raises:
            FileFormatError: If the file is missing, damaged, or holds other weights.
        """
        network = cls()
        expected = {key: tuple(value.shape) for key, value in network.state_dict().items()}
        try:
            with safe_open(existing_file(path), framework="pt") as file:
                if (file.metadata() or {}).get("format") != _FORMAT:
                    raise FileFormatError(f"{path}: not a flow network written by vnca")
                found = {key: tuple(file.get_slice(key).get_shape()) for key in file.keys()}  # noqa: SIM118
                if found != expected:
                    raise FileFormatError(
                        f"{path}: expected the weights {expected}, found {found}; reinstall vnca"
                    )
                state = {key: file.get_tensor(key).float() for key in expected}
        except (SafetensorError, OSError) as error:
            raise FileFormatError(f"{path}: not readable as a flow network ({error})") from error
        if not all(bool(value.isfinite().all()) for value in state.values()):
            raise FileFormatError(f"{path}: holds weights that are not finite; reinstall vnca")
        network.load_state_dict(state)
        return network

    def write(self, path: Path) -> None:
        """Write the weights in half precision.

        Raises:
            OutputError: If the file cannot be written.
        """
        state = {key: value.half().cpu().contiguous() for key, value in self.state_dict().items()}
        with whole_file(path) as temporary:
            temporary.write_bytes(save(state, metadata={"format": _FORMAT}))

    def forward(
        self, before: Float[Tensor, "b r c"], after: Float[Tensor, "b r c"]
    ) -> Float[Tensor, "b 2 r c"]:
        """Pixels that each point of `before` moves until `after`: right, then down.

        Differentiable in both. Where there is nothing to see it is a guess from what is near.

        Args:
            before: Grey, as displayed (sRGB), 0–1.
            after: The same size.

        Raises:
            ShapeError: If the pictures differ in size or are smaller than 32×32.
        """
        return self.scales(before, after)[-1]

    def scales(
        self, before: Float[Tensor, "b r c"], after: Float[Tensor, "b r c"]
    ) -> list[Float[Tensor, "b 2 r c"]]:
        """What is known after each scale, coarse to fine, all as `forward` gives it.

        Raises:
            ShapeError: As `forward`.
        """
        if before.ndim != 3 or before.shape != after.shape or min(before.shape[1:]) < SMALLEST:
            raise ShapeError(
                f"pictures for optical flow: expected two of [b, r, c] with at least {SMALLEST} "
                f"rows and columns, got {tuple(before.shape)} and {tuple(after.shape)}"
            )
        rows, columns = before.shape[1:]
        pyramid = _pyramid(_normalised(torch.stack([before, after], dim=1)))
        coarsest = pyramid[-1]
        size = (coarsest.shape[2] // 2, coarsest.shape[3] // 2)
        flow = coarsest.new_zeros(len(before), 2, *size)
        hidden = coarsest.new_zeros(len(before), _HIDDEN, *size)
        found: list[Tensor] = []
        for pair in reversed(pyramid):
            if pair is not coarsest:
                flow, hidden = 2 * _doubled(flow), _doubled(hidden)
                moved = _moved_back(pair[:, 1:], _doubled(flow))
                pair = torch.cat([pair[:, :1], moved], dim=1)
            hidden = functional.relu(
                self.first(torch.cat([self._energies(pair), flow, hidden], dim=1))
            )
            hidden = functional.relu(self.second(hidden))
            flow = flow + self.rest(hidden)
            found.append(flow)
        full = pyramid[0].shape[2:]
        return [
            functional.interpolate(
                flow * (full[0] / flow.shape[2] / 2), full, mode="bilinear", align_corners=False
            )[:, :, :rows, :columns]
            for flow in found
        ]

    def _energies(self, pair: Tensor) -> Tensor:
        """Motion energies over their sum, and the logarithm of the sum; half the rows, columns."""
        margin = _KERNEL // 2 - 1
        seen = self.filters(functional.pad(pair, [margin] * 4, mode="replicate"))
        energy = functional.avg_pool2d(
            seen.square(), 3, stride=1, padding=1, count_include_pad=False
        )
        total = energy.sum(dim=1, keepdim=True) + _STILL
        return torch.cat([_ENERGIES * energy / total, total.log()], dim=1)


def _moving_gratings() -> Tensor:
    """What the filters are before training: gratings that move, in pairs a quarter apart.

    Eight directions of two wavelengths in turn, each with four steps of phase between the
    pictures. From random filters training finds such ones too, but slowly.
    """
    along = torch.arange(_KERNEL) - (_KERNEL - 1) / 2
    window = torch.exp(-(along.square() + along[:, None].square()) / (2 * 2.5**2))
    filters: list[Tensor] = []
    for direction in range(8):
        angle, wavenumber = pi * direction / 8, 2 * pi / (4.5, 8.0)[direction % 2]
        phase = wavenumber * (along * cos(angle) + along[:, None] * sin(angle))
        for step in range(4):
            for quarter in range(2):
                start = phase + pi / 2 * quarter
                pair = torch.stack([start.cos(), (start - pi / 2 * step).cos()]) * window
                filters.append(pair - pair.mean(dim=(1, 2), keepdim=True))
    return torch.stack(filters) / _KERNEL


def _normalised(pair: Tensor) -> Tensor:
    """Zero mean and unit contrast over both pictures together, finite for empty ones."""
    centred = pair - pair.mean(dim=(1, 2, 3), keepdim=True)
    return centred * (centred.square().mean(dim=(1, 2, 3), keepdim=True) + 1e-5).rsqrt()


def _pyramid(pair: Tensor) -> list[Tensor]:
    """The pair and its halvings, fine to coarse; the border is repeated until all can be halved."""
    rows, columns = pair.shape[2:]
    halvings = max(1, (min(rows, columns) // _COARSEST).bit_length() - 1)
    unit = 2 ** (halvings + 1)
    pair = functional.pad(pair, (0, -columns % unit, 0, -rows % unit), mode="replicate")
    ramp = pair.new_tensor([1, 3, 3, 1]) / 8
    blur = torch.outer(ramp, ramp).expand(2, 1, 4, 4)
    pyramid = [pair]
    for _ in range(halvings):
        padded = functional.pad(pyramid[-1], [1] * 4, mode="replicate")
        pyramid.append(functional.conv2d(padded, blur, stride=2, groups=2))
    return pyramid


def _doubled(field: Tensor) -> Tensor:
    return functional.interpolate(field, scale_factor=2, mode="bilinear", align_corners=False)


def _moved_back(picture: Tensor, flow: Tensor) -> Tensor:
    """`picture` `[b, 1, r, c]` as it was before `flow`: at each pixel, what lies where it goes.

    Bilinear; beyond the border its pixels go on. Written out, because on CUDA the gradient of
    grid_sample adds up in any order, and torch refuses it where runs are to be equal.
    """
    rows, columns = picture.shape[2:]
    down = torch.arange(rows, dtype=flow.dtype, device=flow.device)[:, None] + flow[:, 1]
    right = torch.arange(columns, dtype=flow.dtype, device=flow.device) + flow[:, 0]
    (above, below, lower), (before, after, further) = _between(down, rows), _between(right, columns)
    first = torch.arange(len(picture), device=flow.device)[:, None, None] * rows
    pixels = picture.reshape(-1)

    def row(line: Tensor) -> Tensor:
        begin = (first + line) * columns
        left, next_ = (pixels[begin + pixel] for pixel in (before, after))
        return left + (next_ - left) * further

    upper = row(above)
    return (upper + (row(below) - upper) * lower)[:, None]


def _between(at: Tensor, count: int) -> tuple[Tensor, Tensor, Tensor]:
    """The pixels of a line of so many that places lie between, and how far from the first."""
    at = at.clamp(0, count - 1)
    first = at.detach().floor().clamp_max(max(0, count - 2))
    place = first.long()
    return place, (place + 1).clamp_max(count - 1), at - first
