"""Turn smoke simulations into moving paintings.

What is named here is the library's face. It is imported when it is first used, so that
`import vnca` is quick and needs neither numpy nor torch.
"""

import os
from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

# Before CUDA starts: without it torch 2.8 to 2.10 refuses products of matrices on a GPU that are to
# be the same in every run, as in training.
os.environ.setdefault("CUBLAS_WORKSPACE_CONFIG", ":4096:8")

if TYPE_CHECKING:
    from vnca.core import Box
    from vnca.core.camera import Orthographic, Perspective, frame_box
    from vnca.core.errors import Cancelled, VncaError
    from vnca.core.lattice import Lattice
    from vnca.core.volume import Volume
    from vnca.direction import Direction
    from vnca.direction.shot import Shot
    from vnca.features import load_network
    from vnca.io import SmokeFormat, read_smoke, smoke_box, write_painted, write_smoke
    from vnca.io.film import FilmWriter
    from vnca.io.picture import read_image, write_image
    from vnca.io.sequence import find_frames
    from vnca.io.vdb import open_vdb, write_vdb
    from vnca.painting import Painting, StylizeConfig
    from vnca.painting import stylize as stylize_frames
    from vnca.recipe import Watch, load
    from vnca.recipe.evaluation import Evaluation, evaluate
    from vnca.recipe.film import FilmConfig
    from vnca.recipe.paint import paint
    from vnca.recipe.rendering import render
    from vnca.recipe.simulation import simulate
    from vnca.recipe.smoke import train
    from vnca.recipe.stylizing import PaintedFrame, stylize
    from vnca.recipe.texture import texture
    from vnca.rendering.view import View
    from vnca.rendering.view import render as render_view
    from vnca.rule import Rule, RuleConfig, Scales
    from vnca.rule.conditioning import Conditioning, register_conditioning
    from vnca.rule.model import Model
    from vnca.simulation import simulate as simulate_smoke
    from vnca.training.config import SmokeConfig, TextureConfig
    from vnca.training.loop import Trainer
    from vnca.training.presets import preset
    from vnca.training.terms import Iteration, Term
    from vnca.training.trainers import smoke_trainer

# Functions that share the name of a subpackage have one of their own here: an imported
# subpackage takes its name in this one.
_HOMES = {
    "paint": "recipe.paint",
    "train": "recipe.smoke",
    "texture": "recipe.texture",
    "stylize": "recipe.stylizing",
    "simulate": "recipe.simulation",
    "render": "recipe.rendering",
    "load": "recipe",
    "evaluate": "recipe.evaluation",
    "TextureConfig": "training.config",
    "Iteration": "training.terms",
    "Term": "training.terms",
    "PaintedFrame": "recipe.stylizing",
    "Evaluation": "recipe.evaluation",
    "FilmConfig": "recipe.film",
    "Watch": "recipe",
    "Cancelled": "core.errors",
    "Box": "core",
    "Conditioning": "rule.conditioning",
    "register_conditioning": "rule.conditioning",
    "Direction": "direction",
    "Shot": "direction.shot",
    "FilmWriter": "io.film",
    "Lattice": "core.lattice",
    "Model": "rule.model",
    "Orthographic": "core.camera",
    "Painting": "painting",
    "Perspective": "core.camera",
    "Rule": "rule",
    "RuleConfig": "rule",
    "Scales": "rule",
    "SmokeFormat": "io",
    "StylizeConfig": "painting",
    "SmokeConfig": "training.config",
    "Trainer": "training.loop",
    "View": "rendering.view",
    "VncaError": "core.errors",
    "Volume": "core.volume",
    "find_frames": "io.sequence",
    "frame_box": "core.camera",
    "load_network": "features",
    "open_vdb": "io.vdb",
    "preset": "training.presets",
    "read_image": "io.picture",
    "read_smoke": "io",
    "render_view": "rendering.view:render",
    "simulate_smoke": "simulation:simulate",
    "smoke_box": "io",
    "smoke_trainer": "training.trainers",
    "stylize_frames": "painting:stylize",
    "write_image": "io.picture",
    "write_painted": "io",
    "write_smoke": "io",
    "write_vdb": "io.vdb",
}

__all__ = [
    "Box",
    "Cancelled",
    "Conditioning",
    "Direction",
    "Evaluation",
    "FilmConfig",
    "FilmWriter",
    "Iteration",
    "Lattice",
    "Model",
    "Orthographic",
    "PaintedFrame",
    "Painting",
    "Perspective",
    "Rule",
    "RuleConfig",
    "Scales",
    "Shot",
    "SmokeConfig",
    "SmokeFormat",
    "StylizeConfig",
    "Term",
    "TextureConfig",
    "Trainer",
    "View",
    "VncaError",
    "Volume",
    "Watch",
    "evaluate",
    "find_frames",
    "frame_box",
    "load",
    "load_network",
    "open_vdb",
    "paint",
    "preset",
    "read_image",
    "read_smoke",
    "register_conditioning",
    "render",
    "render_view",
    "simulate",
    "simulate_smoke",
    "smoke_box",
    "smoke_trainer",
    "stylize",
    "stylize_frames",
    "texture",
    "train",
    "write_image",
    "write_painted",
    "write_smoke",
    "write_vdb",
]


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'vnca' has no attribute {name!r}")
    module, _, own = _HOMES[name].partition(":")
    value = getattr(import_module(f"vnca.{module}"), own or name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
