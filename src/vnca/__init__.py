"""Turn smoke simulations into moving paintings.

What is named here is the library's face. It is imported when it is first used, so that
`import vnca` is quick and needs neither numpy nor torch.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from vnca.automaton.model import Model
    from vnca.automaton.rule import Rule, RuleConfig, Scales
    from vnca.automaton.stepper import stepper
    from vnca.camera import Orthographic, Perspective, frame_box
    from vnca.errors import VncaError
    from vnca.features.load import load_network
    from vnca.io.image import read_image, write_image
    from vnca.io.sequence import find_frames
    from vnca.io.smoke import SmokeFormat, read_smoke, smoke_box, write_painted, write_smoke
    from vnca.io.vdb import open_vdb, write_vdb
    from vnca.io.video import FilmWriter
    from vnca.lattice import Lattice
    from vnca.render.view import View
    from vnca.render.view import render as render_view
    from vnca.simulate.scenes import simulate as simulate_smoke
    from vnca.stylize.config import StylizeConfig
    from vnca.stylize.roll import Painting
    from vnca.stylize.roll import stylize as stylize_frames
    from vnca.training.config import PRESETS, TrainConfig
    from vnca.training.loop import Trainer
    from vnca.training.smoke import smoke_trainer
    from vnca.typing import Box
    from vnca.volume import Volume

# Functions that share the name of a subpackage have one of their own here: an imported
# subpackage takes its name in this one.
_HOMES = {
    "Box": "typing",
    "FilmWriter": "io.video",
    "Lattice": "lattice",
    "Model": "automaton.model",
    "Orthographic": "camera",
    "PRESETS": "training.config",
    "Painting": "stylize.roll",
    "Perspective": "camera",
    "Rule": "automaton.rule",
    "RuleConfig": "automaton.rule",
    "Scales": "automaton.rule",
    "SmokeFormat": "io.smoke",
    "StylizeConfig": "stylize.config",
    "TrainConfig": "training.config",
    "Trainer": "training.loop",
    "View": "render.view",
    "VncaError": "errors",
    "Volume": "volume",
    "find_frames": "io.sequence",
    "frame_box": "camera",
    "load_network": "features.load",
    "open_vdb": "io.vdb",
    "read_image": "io.image",
    "read_smoke": "io.smoke",
    "render_view": "render.view:render",
    "simulate_smoke": "simulate.scenes:simulate",
    "smoke_box": "io.smoke",
    "smoke_trainer": "training.smoke",
    "stepper": "automaton.stepper",
    "stylize_frames": "stylize.roll:stylize",
    "write_image": "io.image",
    "write_painted": "io.smoke",
    "write_smoke": "io.smoke",
    "write_vdb": "io.vdb",
}

__all__ = [
    "PRESETS",
    "Box",
    "FilmWriter",
    "Lattice",
    "Model",
    "Orthographic",
    "Painting",
    "Perspective",
    "Rule",
    "RuleConfig",
    "Scales",
    "SmokeFormat",
    "StylizeConfig",
    "TrainConfig",
    "Trainer",
    "View",
    "VncaError",
    "Volume",
    "find_frames",
    "frame_box",
    "load_network",
    "open_vdb",
    "read_image",
    "read_smoke",
    "render_view",
    "simulate_smoke",
    "smoke_box",
    "smoke_trainer",
    "stepper",
    "stylize_frames",
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
