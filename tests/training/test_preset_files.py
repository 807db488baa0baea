import dataclasses
from pathlib import Path

import pytest

from vnca.core.errors import FileFormatError, OptionError
from vnca.training.config import SmokeConfig, TextureConfig, TrainingConfig
from vnca.training.presets import FOLDERS, as_toml, preset, preset_names

ALL = [(kind, name) for kind in FOLDERS for name in preset_names(kind)]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "mine.toml"


def test_the_package_has_presets_for_smoke_and_textures() -> None:
    assert preset_names(SmokeConfig) == ["draft", "authors", "paper", "standard"]
    assert preset_names(TextureConfig) == ["draft", "standard"]


@pytest.mark.parametrize(("kind", "name"), ALL)
def test_a_preset_that_is_written_is_read_back_the_same(
    kind: type[TrainingConfig], name: str, file: Path
) -> None:
    config = dataclasses.replace(preset(kind, name), seed=7, learning_rate=1e-7)
    file.write_text(as_toml(config, "draft"))
    assert preset(kind, file) == config


def test_numbers_are_of_the_kind_that_options_have(file: Path) -> None:
    file.write_text('base = "draft"\nlearning_rate = 1\nmilestones = [1]\n')
    config = preset(SmokeConfig, file)
    assert type(config.learning_rate) is float
    assert type(config.milestones[0]) is float
    assert config.iterations == preset(SmokeConfig, "draft").iterations


def test_the_paper_preset_is_the_papers() -> None:
    paper = preset(SmokeConfig, "paper")
    assert paper.view.mode == "paper"
    assert paper.appearance.pixels == 0
    assert paper.rule.position_prior
    assert paper.texture == 0


def test_what_a_base_chooses_can_be_left_to_the_training_again(file: Path) -> None:
    assert preset(SmokeConfig, "paper").appearance.style_scale == 1
    file.write_text('base = "paper"\n[appearance]\nstyle_scale = "none"\n')
    assert preset(SmokeConfig, file).appearance.style_scale is None


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("iterations = 5", "rule.channels and "),
        ('base = "best"', "base = 'best': expected one of draft, authors, paper, standard"),
        ('base = "draft"\niterations = "many"', "iterations 'many': expected a whole number"),
        ('base = "draft"\niterations = true', "iterations True: expected a whole number"),
        ('base = "draft"\niterations = 0', "iterations 0: at least 1"),
        ('base = "draft"\niteration = 9', "iteration: no such option; did you mean iterations"),
        ('base = "draft"\n[view]\nsize = 4', "view.size 4"),
        ('base = "draft"\n[view]\nsizes = 64', "view.sizes: no such option"),
        ('base = "draft"\n[view]\nmode = "odd"', "view.mode 'odd': expected emission-absorption"),
        ('base = "draft"\nview = 64', "view 64"),
        ('base = "draft"\nmilestones = ["a"]', "milestones"),
        ('base = "draft"\nlearning_rate = nan', "learning_rate"),
        ("[[", "not TOML"),
    ],
)
def test_a_file_that_cannot_be_is_refused_by_its_name_and_key(
    file: Path, text: str, told: str
) -> None:
    file.write_text(text)
    with pytest.raises(FileFormatError) as refused:
        preset(SmokeConfig, file)
    assert str(refused.value).startswith(f"{file}: ")
    assert told in str(refused.value)
    assert "`" not in str(refused.value)


def test_a_file_that_is_not_there_or_no_text_is_refused(file: Path) -> None:
    with pytest.raises(FileFormatError, match=r"mine\.toml"):
        preset(SmokeConfig, file)
    file.write_bytes(b"\xff\xfe")
    with pytest.raises(FileFormatError, match=r"mine\.toml: cannot be read as text"):
        preset(SmokeConfig, file)
    with pytest.raises(OptionError, match=r"`preset` best: expected one of draft, standard"):
        preset(TextureConfig, "best")
