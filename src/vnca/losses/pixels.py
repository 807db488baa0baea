"""The picture itself as layer zero: do its colours occur in the style, and the reverse?"""

from jaxtyping import Float
from torch import Tensor

from vnca.losses.style import cosine_cost, relaxed_earth_movers_distance

# Analogue YUV (BT.601): brightness apart from two differences of colour
_YUV = (
    (0.299, 0.587, 0.114),
    (-0.14713, -0.28886, 0.436),
    (0.615, -0.51499, -0.10001),
)
_SMALLEST_SQUARE = 1e-8


def to_yuv(rgb: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
    """BT.601 brightness in 0–1 and two colour differences about zero, from sRGB in 0–1."""
    return rgb @ rgb.new_tensor(_YUV).T


def palette_distance(x: Float[Tensor, "n 3"], y: Float[Tensor, "m 3"]) -> Float[Tensor, ""]:
    """Relaxed earth mover's distance between two sets of sRGB pixels.

    The cost is the Euclidean distance in YUV plus one minus the cosine there. Differentiable in
    both.

    Reference: Kolkin, Salavon and Shakhnarovich 2019, section 2.3 (L_p).
    """
    return relaxed_earth_movers_distance(to_yuv(x), to_yuv(y), _yuv_cost)


def luma(rgb: Float[Tensor, "b 3 r c"]) -> Float[Tensor, "b 3 r c"]:
    """The BT.601 brightness of sRGB in all three channels."""
    weights = rgb.new_tensor(_YUV[0]).view(1, 3, 1, 1)
    return (rgb * weights).sum(1, keepdim=True).expand_as(rgb)


def _yuv_cost(x: Tensor, y: Tensor) -> Tensor:
    inner = x @ y.mT
    squares = (x * x).sum(-1)[..., :, None] + (y * y).sum(-1)[..., None, :] - 2 * inner
    return squares.clamp_min(_SMALLEST_SQUARE).sqrt() + cosine_cost(x, y)
