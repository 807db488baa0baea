"""Nothing that training differentiates adds up in another order from run to run on a GPU.

Torch refuses such operations there when it is told that runs are to be equal, as in training; here
whole iterations run on the CPU, and the operations are looked up.
"""

import dataclasses
import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor
from torch.nn import functional
from torch.overrides import TorchFunctionMode
from torch.utils._python_dispatch import TorchDispatchMode

from vnca.core import FloatArray
from vnca.core.volume import Volume
from vnca.features.vgg import VGG16
from vnca.training.config import PoolConfig, SliceConfig, SmokeConfig, TextureConfig
from vnca.training.trainers import smoke_trainer, texture_trainer

REFUSED = {
    "torch.nn.AvgPool3d": r"avg_pool3d_backward",
    "torch.nn.AdaptiveAvgPool2d": r"_?adaptive_avg_pool2d_backward",
    "torch.nn.AdaptiveAvgPool3d": r"_?adaptive_avg_pool3d_backward",
    "torch.nn.MaxPool3d": r"max_pool3d_with_indices_backward",
    "torch.nn.AdaptiveMaxPool2d": r"adaptive_max_pool2d_backward",
    "torch.nn.FractionalMaxPool2d": r"fractional_max_pool2d_backward",
    "torch.nn.FractionalMaxPool3d": r"fractional_max_pool3d_backward",
    "torch.nn.MaxUnpool1d": r"max_unpool2d",
    "torch.nn.MaxUnpool2d": r"max_unpool2d",
    "torch.nn.MaxUnpool3d": r"max_unpool3d",
    "torch.nn.functional.interpolate": r"_?upsample_(linear|bi|tri)\w*_backward",
    "torch.nn.ReflectionPad1d": r"reflection_pad1d_backward",
    "torch.nn.ReflectionPad2d": r"reflection_pad2d_backward",
    "torch.nn.ReflectionPad3d": r"reflection_pad3d_backward",
    "torch.nn.ReplicationPad1d": r"replication_pad1d_backward",
    "torch.nn.ReplicationPad2d": r"replication_pad2d_backward",
    "torch.nn.ReplicationPad3d": r"replication_pad3d_backward",
    "torch.nn.NLLLoss": r"nll_loss\w*",
    "torch.nn.CTCLoss": r"_?ctc_loss_backward",
    "torch.nn.Embedding": r"embedding_dense_backward",
    "torch.nn.EmbeddingBag": r"_embedding_bag\w*_backward",
    "torch.Tensor.put_": r"put_?",
    "torch.histc": r"histc",
    "torch.bincount": r"bincount",
    "torch.kthvalue": r"kthvalue",
    "torch.median": r"(nan)?median",
    "torch.nn.functional.grid_sample": r"grid_sampler_[23]d_backward|cudnn_grid_sampler_backward",
    "torch.cumsum": r"cumsum",
    "torch.Tensor.scatter_reduce": r"scatter_reduce_?",
    "torch.Tensor.resize_": r"resize_",
}
"""What torch says that it refuses on CUDA when runs are to be equal, in torch 2.8 or later, and
the operations that this is below autograd."""
OF_OTHER_DEVICES = {"torch.Tensor.index_put", "torch.Tensor.index_reduce", "torch.nn.MaxPool2d"}
"""What it says that it refuses on MPS alone."""


class OnGpu(TorchFunctionMode):
    """Tensors say that they are on a GPU, so that torch and vnca take the ways they take there."""

    def __torch_function__(self, function: Any, types: Any, args: Any = (), kwargs: Any = None):
        if function == Tensor.is_cuda.__get__:  # pyright: ignore[reportFunctionMemberAccess]
            return True
        if function == Tensor.is_cpu.__get__:  # pyright: ignore[reportFunctionMemberAccess]
            return False
        return function(*args, **(kwargs or {}))


class Recorder(TorchDispatchMode):
    """Remembers what is computed."""

    def __init__(self) -> None:
        super().__init__()
        self.names: set[str] = set()
        self.refused: set[str] = set()

    def __torch_dispatch__(self, function: Any, types: Any, args: Any = (), kwargs: Any = None):
        name = function.overloadpacket.__name__
        self.names.add(name)
        if any(re.fullmatch(form, name) for form in REFUSED.values()) and not _of_whole(name, args):
            self.refused.add(name)
        return function(*args, **(kwargs or {}))


def _of_whole(name: str, args: tuple[Any, ...]) -> bool:
    """Whether it is a sum of whole numbers, which has but one result."""
    return name in ("cumsum", "bincount") and not args[0].is_floating_point()


@contextmanager
def recorded() -> Iterator[Recorder]:
    before = torch.are_deterministic_algorithms_enabled()
    torch.use_deterministic_algorithms(True)
    try:
        with pytest.MonkeyPatch.context() as patch, OnGpu(), Recorder() as recorder:
            # Or the functions written in Python would be asked of the mode as a whole.
            for name in ("has_torch_function_unary", "has_torch_function_variadic"):
                patch.setattr(functional, name, lambda *tensors: False)
            yield recorder
    finally:
        torch.use_deterministic_algorithms(before)


@pytest.mark.parametrize("has_decoder", [False, True])
@pytest.mark.parametrize("mode", ["emission-absorption", "paper"])
def test_training_on_smoke_is_the_same_in_every_run(
    tiny_smoke: Volume,
    style: FloatArray,
    tiny_config: SmokeConfig,
    vgg: VGG16,
    mode: Any,
    has_decoder: bool,
) -> None:
    config = dataclasses.replace(
        tiny_config,
        augment=True,
        pool=PoolConfig(size=1, reseed_every=1000),
        decoder=8 if has_decoder else 0,
        view=dataclasses.replace(tiny_config.view, mode=mode),
        motion=dataclasses.replace(tiny_config.motion, size=32, opacity_threshold=0.0, slowest=0.0),
    )
    trainer = smoke_trainer(tiny_smoke, style, config, vgg)
    output = np.random.default_rng(0).normal(0, 0.1, trainer.rule().output.shape)
    trainer.begin_with(dataclasses.replace(trainer.rule(), output=output.astype(np.float32)))
    trainer.improve()  # a state of zeros has no motion
    with recorded() as recorder:
        progress = trainer.improve()
    assert progress.terms["motion"] > 0
    assert {"convolution_backward", "index_put", "addmm"} & recorder.names
    assert not recorder.refused


@pytest.mark.parametrize("has_decoder", [False, True])
def test_training_on_a_texture_is_the_same_in_every_run(
    style: FloatArray, tiny_config: SmokeConfig, vgg: VGG16, has_decoder: bool
) -> None:
    config = TextureConfig(
        rule=dataclasses.replace(tiny_config.rule, density_prior=False, velocity_prior=False),
        appearance=tiny_config.appearance,
        slice=SliceConfig(size=32, count=1, pixels_per_cell=2.0),
        block=16,
        decoder=8 if has_decoder else 0,
        iterations=3,
        shortest_rollout=2,
        longest_rollout=4,
    )
    trainer = texture_trainer(style, config, vgg)
    with recorded() as recorder:
        trainer.improve()
    assert "convolution_backward" in recorder.names
    assert not recorder.refused


def test_an_operation_without_such_a_gradient_is_found() -> None:
    """The one that motion was once looked for with."""
    picture = torch.rand(1, 1, 8, 8, requires_grad=True)
    with recorded() as recorder:
        grid = torch.rand(1, 8, 8, 2)
        functional.grid_sample(picture, grid, align_corners=False).sum().backward()
    assert recorder.refused == {"grid_sampler_2d_backward"}


def test_all_that_torch_refuses_is_listed() -> None:
    """A later torch may refuse more."""
    told = torch.use_deterministic_algorithms.__doc__
    assert told is not None
    found = re.search(
        r"operations will throw a\s+:class:`RuntimeError` when(.*?)In addition", told, re.DOTALL
    )
    assert found is not None
    refusing = found[1]
    named = set(re.findall(r":(?:class|func):`([\w.]+)`", refusing)) - {"RuntimeError"}
    assert len(named) > 20
    assert named <= {*REFUSED, *OF_OTHER_DEVICES}
