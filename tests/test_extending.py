"""The examples of docs/design.md of what is added to vnca do what they say."""

import re
import sys
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

import vnca
from vnca import engine as sessions
from vnca.core.volume import Volume
from vnca.engine.domain import Domain
from vnca.io import smoke_format
from vnca.rule import conditioning
from vnca.rule.conditioning import priors

DESIGN = (Path(__file__).parents[1] / "docs" / "design.md").read_text()


def example(file: str) -> str:
    """The code that the design shows for a file."""
    (code,) = re.findall(rf"```python\n# {re.escape(file)}\n(.*?)```", DESIGN, re.DOTALL)
    return code


def imported(monkeypatch: pytest.MonkeyPatch, file: str) -> ModuleType:
    """A module of that code, under the name that the file would have."""
    name = file.removeprefix("src/").removesuffix(".py").removesuffix("/__init__")
    module = ModuleType(name.replace("/", "."))
    exec(compile(example(file), file, "exec"), module.__dict__)
    monkeypatch.setitem(sys.modules, module.__name__, module)
    return module


def rule(*names: str) -> vnca.Rule:
    """A rule whose output weights are not zero, conditioned on some inputs."""
    config = vnca.RuleConfig(hidden=8, conditioning=names, update_probability=1.0)
    initial = vnca.Rule.initial(config, vnca.Scales(velocity=0.5), seed=1)
    output = np.random.default_rng(2).normal(0, 0.05, initial.output.shape).astype(np.float32)
    return replace(initial, output=output)


def test_a_conditioning_field(
    tiny_smoke: Volume, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    here = dict(conditioning.__dict__)
    exec(example("src/vnca/rule/conditioning.py"), here)
    monkeypatch.setitem(conditioning._KNOWN, "speed", here["SPEED"])
    own = rule("density", "speed")
    domain = Domain.filling(tiny_smoke.box)
    told = priors(domain, tiny_smoke, own)
    assert told.shape == (len(domain), 2)
    assert tiny_smoke.velocity is not None
    at = domain.cells - tiny_smoke.origin
    speed = np.linalg.norm(tiny_smoke.velocity, axis=-1)[tuple(at.T)]
    np.testing.assert_allclose(told[:, 1], np.minimum(speed / 0.5, 2), atol=1e-6)
    vnca.Model(own).save(tmp_path / "m.safetensors")
    assert vnca.load(tmp_path / "m.safetensors").rule.config == own.config
    frames = (tiny_smoke, replace(tiny_smoke, velocity=np.zeros_like(tiny_smoke.velocity)))
    moving, resting = (next(iter(vnca.stylize(vnca.Model(own), [f]))) for f in frames)
    assert not np.array_equal(moving.colour, resting.colour)


def test_a_file_format(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    file = "src/vnca/io/raw.py"
    module = imported(monkeypatch, file)
    (suffix, home), *_ = re.findall(r'`"(\.raw)": "([a-z.]+)"`', DESIGN)
    assert home == module.__name__
    monkeypatch.setitem(smoke_format._HOMES, suffix, home)
    density = np.random.default_rng(0).random((6, 6, 6), np.float32)
    for number in (1, 2):
        density.tofile(tmp_path / f"s_{number:03d}.raw")
    np.testing.assert_array_equal(vnca.read_smoke(tmp_path / "s_001.raw").density, density)
    model = vnca.Model(rule("density"))
    painted = list(vnca.stylize(model, tmp_path, out=tmp_path / "out"))
    assert [frame.number for frame in painted] == [1, 2]
    with vnca.open_vdb(tmp_path / "out" / "s_002.vdb") as written:
        assert written.names == ("density", "Cd")
    (tmp_path / "s_003.raw").write_bytes(bytes(20))
    with pytest.raises(vnca.VncaError, match=r"s_003\.raw: 5 numbers fill no cube"):
        vnca.read_smoke(tmp_path / "s_003.raw")


def test_a_backend(tiny_smoke: Volume, monkeypatch: pytest.MonkeyPatch) -> None:
    module = imported(monkeypatch, "src/vnca/engine/double.py")
    name = module.BACKEND.name
    assert f'`"{name}"`' in DESIGN
    monkeypatch.setattr(sessions, "BACKENDS", (*sessions.BACKENDS, name))
    own, domain = rule("density", "velocity"), Domain.filling(tiny_smoke.box)
    told = priors(domain, tiny_smoke, own)
    states = []
    for backend in (name, "reference"):
        compute = sessions.Compute(backend)
        session = sessions.open_session(own.automaton(0), domain, told, compute)
        states.append(session.read(session.run(session.upload(domain.seed(12)), range(4))))
    assert states[0].dtype == np.float32
    np.testing.assert_allclose(*states, atol=1e-5)
    assert states[0].any()
