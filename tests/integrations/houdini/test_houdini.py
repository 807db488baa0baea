"""The Houdini package, with a `hou` that is faked: it was not run in Houdini."""

import importlib
import json
import sys
import time
import types
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from unittest.mock import MagicMock
from xml.etree import ElementTree

import numpy as np
import pytest

from vnca.cli import main
from vnca.core.volume import Volume
from vnca.io import write_smoke
from vnca.io.vdb import open_vdb, write_vdb
from vnca.rule.library import style_names

ROOT = Path(__file__).parents[3] / "integrations" / "houdini"
NAMES = ("request", "work", "node", "farm", "asset")


class Modules(types.SimpleNamespace):
    """The package's modules by name, and the faked `hou`."""

    request: Any
    work: Any
    node: Any
    farm: Any
    asset: Any
    hou: Any


@pytest.fixture
def package(monkeypatch: pytest.MonkeyPatch) -> Iterator[Modules]:
    hou = MagicMock()
    hou.NodeError = type("NodeError", (Exception,), {})
    hou.NodeWarning = type("NodeWarning", (Exception,), {})
    hou.VDB = type("VDB", (), {})
    hou.fps.return_value = 24.0
    monkeypatch.setitem(sys.modules, "hou", hou)
    monkeypatch.syspath_prepend(str(ROOT / "python"))
    modules = {name: importlib.import_module(f"vnca_houdini.{name}") for name in NAMES}
    yield Modules(hou=hou, **modules)
    for name in [name for name in sys.modules if name.startswith("vnca_houdini")]:
        del sys.modules[name]


def painting(package: Modules, folder: Path, **changed: Any) -> Any:
    values = {"style": "ink", "model": "", "first": 1, "last": 1, "fps": 24.0} | changed
    return package.request.Painting(folder=folder, **values)


def node_of(package: Modules, folder: Path, **changed: Any) -> MagicMock:
    values = {
        "style": "ink", "model": "", "folder": str(folder), "timescale": 1.0, "strength": 1.0,
        "densitystrength": 1.0, "refine": 1, "seed": 0,
    } | changed  # fmt: skip
    node = MagicMock()

    def parm(name: str) -> MagicMock:
        return MagicMock(evalAsString=lambda: str(values[name]), eval=lambda: values[name])

    node.parm.side_effect = parm
    node.parmTuple.return_value.eval.return_value = (1, 2)
    return node


def houdini_smoke(path: Path) -> None:
    """Smoke as Houdini writes it: y up, `density` and `vel` in metres a second."""
    density = np.zeros((10, 10, 10), np.float32)
    density[2:8, 2:8, 2:8] = 1
    velocity = np.broadcast_to(np.float32([0, 0, 1 / 24]), (10, 10, 10, 3)).copy()
    write_smoke(path, Volume(density, velocity, (0, 0, 0), np.diag([0.1, 0.1, 0.1, 1]), 1))
    with open_vdb(path) as file:
        grids = {name: file.read(name) for name in file.grids}
    grids["velocity"].name = "vel"
    grids["velocity"].metadata.pop("velocity_units", None)
    write_vdb(path, [*grids.values()])


def test_the_words_are_ones_that_vnca_takes(package: Modules, tmp_path: Path) -> None:
    asked = painting(package, tmp_path / "Rauch ü")
    asked.source(1).parent.mkdir(parents=True)
    houdini_smoke(asked.source(1))
    assert main(asked.words()) == 0
    with open_vdb(asked.painted(1.0)) as file:
        assert set(file.grids) == {"density", "vel", "Cd"}
        assert file.metadata["vnca_up_axis"].value == "y"
    # Run again, as a farm does, there is nothing to do.
    assert main(asked.words(goes_on=True)) == 0


def test_sub_frames_show_the_frame_before(package: Modules, tmp_path: Path) -> None:
    asked = painting(package, tmp_path)
    names = [asked.painted(frame).name for frame in (7.0, 7.25, 7.99, 6.99999)]
    assert names == ["smoke.0007.vdb"] * 4


def test_a_style_or_a_model_and_some_frames(package: Modules, tmp_path: Path) -> None:
    problem = package.request.ProblemError
    with pytest.raises(problem, match="one of them"):
        painting(package, tmp_path, style="")
    with pytest.raises(problem, match="one of them"):
        painting(package, tmp_path, model="a.png")
    with pytest.raises(problem, match="no frame from 3 to 2"):
        painting(package, tmp_path, first=3, last=2)
    assert painting(package, tmp_path, style="", model="a.png").words()[2] == "a.png"


def test_the_menu_has_the_library(package: Modules) -> None:
    assert sorted(package.node.STYLES) == style_names()


def test_the_program_is_found_or_missed_in_a_line(
    package: Modules, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VNCA", sys.executable)
    assert package.request.program() == sys.executable
    monkeypatch.setenv("VNCA", "/nowhere/vnca")
    with pytest.raises(package.request.ProblemError, match="/nowhere/vnca is no program"):
        package.request.program()


def script(path: Path, code: str) -> list[str]:
    path.write_text(f"import json, sys, time\n{code}\n")
    return [str(path)]


def test_work_is_followed_and_its_error_is_the_message(package: Modules, tmp_path: Path) -> None:
    told: list[tuple[float, str]] = []
    events = [
        {"event": "progress", "what": "painting", "done": 1, "total": 2, "unit": "frames"},
        {"event": "note", "text": "a note"},
        {"event": "unheard of"},
    ]
    lines = "\n".join(f"print({json.dumps(event)!r}, file=sys.stderr)" for event in events)
    words = script(tmp_path / "works.py", lines + "\nprint('no JSON', file=sys.stderr)")
    notes = package.work.run(sys.executable, words, lambda *facts: told.append(facts))
    assert notes == ["a note"]
    # How it starts is told only while there is nothing else to tell.
    assert (0.5, "painting 1 of 2 frames") in told
    assert set(told) <= {(0.0, "starting"), (0.5, "painting 1 of 2 frames")}
    assert told == sorted(told)
    failed = json.dumps({"event": "error", "message": "vnca: why", "exit_code": 2})
    words = script(tmp_path / "fails.py", f"print({failed!r}, file=sys.stderr); sys.exit(2)")
    with pytest.raises(package.request.ProblemError, match="vnca: why"):
        package.work.run(sys.executable, words, lambda *_: None)
    words = script(tmp_path / "dies.py", "sys.exit(3)")
    with pytest.raises(package.request.ProblemError, match="unexpectedly, with code 3"):
        package.work.run(sys.executable, words, lambda *_: None)


def test_esc_ends_the_work(package: Modules, tmp_path: Path) -> None:
    event = {"event": "progress", "what": "painting", "done": 1, "total": 2, "unit": "frames"}
    code = f"print({json.dumps(event)!r}, file=sys.stderr, flush=True)\ntime.sleep(600)"

    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    for source in (code, "time.sleep(600)"):  # also before it says anything
        begun = time.monotonic()
        with pytest.raises(KeyboardInterrupt):
            package.work.run(sys.executable, script(tmp_path / "long.py", source), interrupted)
        assert time.monotonic() - begun < 60  # and does not wait for ten minutes


def test_a_node_writes_its_input_and_has_it_painted(
    package: Modules, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    node, source = node_of(package, tmp_path), MagicMock()
    geometry = source.geometryAtFrame.return_value
    geometry.prims.return_value = [package.hou.VDB()]
    node.inputs.return_value = [source]
    ran: list[Any] = []
    monkeypatch.setattr(package.work, "run", lambda *words: ran.append(words))
    monkeypatch.setattr(package.node, "program", lambda: "vnca")
    package.node.paint(node)
    written = [call.args[0] for call in geometry.saveToFile.call_args_list]
    assert written == [str(tmp_path / "smoke" / f"smoke.000{n}.vdb") for n in (1, 2)]
    assert ran[0][1][:3] == ["paint", str(tmp_path / "smoke" / "smoke.####.vdb"), "--style"]
    assert "--overwrite" in ran[0][1]
    node.cook.assert_called_once_with(force=True)
    package.node.paint(node, goes_on=True)
    assert geometry.saveToFile.call_count == 2
    assert "--resume" in ran[1][1]
    geometry.prims.return_value = []
    with pytest.raises(package.hou.NodeError, match="no VDB in frame 1"):
        package.node.paint(node)
    node.inputs.return_value = []
    with pytest.raises(package.hou.NodeError, match="Connect the VDBs"):
        package.node.paint(node)


def test_cooking_shows_the_painted_frame(package: Modules, tmp_path: Path) -> None:
    node = node_of(package, tmp_path)
    package.hou.frame.return_value = 2.5
    with pytest.raises(package.hou.NodeWarning, match=r"smoke\.0002\.vdb is not painted yet"):
        package.node.cook(node)
    path = tmp_path / "painted" / "smoke.0002.vdb"
    path.parent.mkdir()
    path.touch()
    package.node.cook(node)
    node.geometry.return_value.loadFromFile.assert_called_once_with(str(path))
    with pytest.raises(package.hou.NodeError, match="one of them"):
        package.node.cook(node_of(package, tmp_path, style=""))


def test_the_shelf_adds_a_node_behind_the_selected_one(package: Modules) -> None:
    package.hou.selectedNodes.return_value = []
    assert package.node.add_after_selected() is None
    selected = MagicMock()
    package.hou.selectedNodes.return_value = [selected]
    made = package.node.add_after_selected()
    selected.parent().createNode.assert_called_once_with("python", "vnca_paint")
    made.setInput.assert_called_once_with(0, selected)
    made.parm("python").set.assert_called_once_with(package.node.COOK)


def test_a_farm_paints_each_painting_in_one_item(package: Modules, tmp_path: Path) -> None:
    network = MagicMock()
    network.createNode.side_effect = lambda *_: MagicMock()
    asked = [painting(package, tmp_path / f"a {name}", style=name) for name in ("ink", "frost")]
    merged = package.farm.add(network, asked)
    kinds = [call.args[0] for call in network.createNode.call_args_list]
    assert kinds == ["waitforall", "genericgenerator", "genericgenerator"]
    assert merged.setInput.call_count == 2
    assert f"'{tmp_path}/a ink/smoke/smoke.####.vdb'" in package.farm.command(asked[0])
    assert "--resume" in package.farm.command(asked[0])


def test_the_asset_has_the_parameters_and_a_node_that_shows(
    package: Modules, tmp_path: Path
) -> None:
    subnet = package.hou.node.return_value.createNode.return_value.createNode.return_value
    package.asset.build(tmp_path / "vnca.hda")
    shown = subnet.createNode.return_value
    shown.setInput.assert_called_once_with(0, subnet.indirectInputs.return_value[0])
    shown.parm.return_value.set.assert_called_once_with(package.asset.COOK)
    (name,), options = subnet.createDigitalAsset.call_args
    assert name == package.asset.TYPE
    assert options["hda_file_name"] == str(tmp_path / "vnca.hda")
    definition = subnet.createDigitalAsset.return_value.type.return_value.definition.return_value
    definition.setParmTemplateGroup.assert_called_once_with(
        package.hou.ParmTemplateGroup.return_value
    )
    templates = package.hou.ParmTemplateGroup.call_args.args[0]
    assert len(templates) == len(package.node.templates())
    definition.save.assert_called_once_with(str(tmp_path / "vnca.hda"))
    package.hou.node.return_value.createNode.return_value.destroy.assert_called_once_with()
    # The Python SOP cooks by the parameters of the asset around it.
    asset, node = node_of(package, tmp_path), MagicMock()
    package.hou.frame.return_value = 3.0
    (tmp_path / "painted").mkdir()
    (tmp_path / "painted" / "smoke.0003.vdb").touch()
    package.node.cook(node, asset)
    node.geometry.return_value.loadFromFile.assert_called_once_with(
        str(tmp_path / "painted" / "smoke.0003.vdb")
    )
    asset.geometry.assert_not_called()


def named(package: Modules) -> dict[str, dict[str, Any]]:
    """The options of the parameters that the node is given, by name."""
    package.node.templates()
    made = [call for call in package.hou.mock_calls if call[0].endswith("ParmTemplate")]
    return {arguments[0]: options for _, arguments, options in made}


def test_what_is_read_are_the_parameters_of_the_node(package: Modules, tmp_path: Path) -> None:
    node = node_of(package, tmp_path, style="", model="a.png")
    package.node.painting_of(node)
    read = {call.args[0] for call in (*node.parm.call_args_list, *node.parmTuple.call_args_list)}
    assert read == set(named(package)) - {"paint", "goon"}


def test_buttons_cook_and_shelf_call_the_package(
    package: Modules, monkeypatch: pytest.MonkeyPatch
) -> None:
    called: list[tuple[Any, ...]] = []
    for name in ("paint", "cook", "add_after_selected"):

        def note(*words: Any, name: str = name, **options: Any) -> None:
            called.append((name, *words, options))

        monkeypatch.setattr(package.node, name, note)
    pwd = package.hou.pwd.return_value
    parameters = named(package)
    (tool,) = ElementTree.parse(ROOT / "toolbar" / "vnca.shelf").getroot().iter("tool")
    scripts = [
        *(parameters[button]["script_callback"] for button in ("paint", "goon")),
        *(package.node.COOK, package.asset.COOK, tool.findtext("script")),
    ]
    for script in scripts:
        exec(script, {"hou": package.hou})  # as Houdini does
    assert called == [
        ("paint", pwd, {}),
        ("paint", pwd, {"goes_on": True}),
        ("cook", pwd, {}),
        ("cook", pwd, pwd.parent.return_value, {}),
        ("add_after_selected", {}),
    ]


def test_the_package_puts_its_own_folder_on_the_paths() -> None:
    told = json.loads((ROOT / "package.json").read_text())
    assert told["hpath"] == "$HOUDINI_PACKAGE_PATH"
    values = {name: value for each in told["env"] for name, value in each.items()}
    assert values["PYTHONPATH"]["value"] == "$HOUDINI_PACKAGE_PATH/python"
    assert (ROOT / "python" / "vnca_houdini" / "__init__.py").is_file()
