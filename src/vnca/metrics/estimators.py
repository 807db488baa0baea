"""Estimators of optical flow, all called alike."""

import importlib
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from vnca.core.errors import BackendUnavailableError
from vnca.core.typing import FloatArray

if TYPE_CHECKING:
    from vnca.features.flow import FlowNetwork

Estimator: TypeAlias = Callable[[FloatArray, FloatArray], FloatArray]
"""Grey pictures `[row, column]` before and after, as displayed (sRGB, 0–1), to pixels moved,
`[row, column, (right, down)]`, at the pixels of the first."""


def estimators() -> Mapping[str, Estimator]:
    """What sees motion: the network that training uses, and one it never meets.

    Raises:
        BackendUnavailableError: If OpenCV is not installed.
        FileFormatError: If the network's weights are missing or damaged.
    """
    return {"network": ours(), "dis": dis()}


def ours(device: str = "cpu") -> Estimator:
    """The network that training uses.

    Raises:
        FileFormatError: If its weights are missing or damaged.
    """
    from vnca.features.flow import FlowNetwork

    return estimator_of(FlowNetwork.load(device))


def estimator_of(network: "FlowNetwork") -> Estimator:
    """A flow network called like the others."""
    import torch

    device = next(network.parameters()).device

    def estimate(before: FloatArray, after: FloatArray) -> FloatArray:
        pair = torch.from_numpy(np.stack([before, after])[:, None]).float().to(device)
        with torch.no_grad():
            flow = network(pair[0], pair[1])[0]
        return np.ascontiguousarray(flow.permute(1, 2, 0).cpu().numpy())

    return estimate


def dis() -> Estimator:
    """Dense inverse search, preset "medium", down to single pixels.

    Raises:
        BackendUnavailableError: If OpenCV is not installed.

    Reference: Kroeger et al. 2016.
    """
    cv2 = _opencv()
    search = cv2.DISOpticalFlow_create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    search.setFinestScale(0)

    def estimate(before: FloatArray, after: FloatArray) -> FloatArray:
        return search.calc(_bytes(before), _bytes(after), None)

    return estimate


def farneback() -> Estimator:
    """Polynomial expansion, five halvings, windows of 15 pixels.

    Raises:
        BackendUnavailableError: If OpenCV is not installed.

    Reference: Farnebäck 2003.
    """
    cv2 = _opencv()

    def estimate(before: FloatArray, after: FloatArray) -> FloatArray:
        return cv2.calcOpticalFlowFarneback(
            _bytes(before), _bytes(after), None,
            pyr_scale=0.5, levels=5, winsize=15, iterations=3, poly_n=5, poly_sigma=1.1, flags=0,
        )  # fmt: skip

    return estimate


def _opencv() -> Any:
    try:
        return importlib.import_module("cv2")
    except ImportError as error:
        raise BackendUnavailableError(
            "optical flow by OpenCV: it is not installed; pip install 'vnca[evaluate]'"
        ) from error


def _bytes(picture: FloatArray) -> np.ndarray:
    return np.ascontiguousarray(np.rint(np.clip(picture, 0, 1) * 255).astype(np.uint8))
