from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import study
from study import REFERENCE, Findings, Study, table

from vnca.core.errors import FileFormatError, OptionError
from vnca.recipe.smoke import SmokeRun
from vnca.rule import Rule, Scales
from vnca.rule.model import MODEL_NAME, Model
from vnca.training.checkpoint import CHECKPOINT_NAME

Make = Callable[..., Study]


@pytest.fixture
def make(tmp_path: Path) -> Make:
    """A study of files of a few bytes."""
    frame, style = tmp_path / "frame.vdb", tmp_path / "style.png"
    frame.write_bytes(b"smoke")
    style.write_bytes(b"paint")

    def made(**options: object) -> Study:
        return replace(Study(tmp_path / "out", frame, style, iterations=3), **options)

    return made


@pytest.fixture
def trainings(monkeypatch: pytest.MonkeyPatch) -> list[SmokeRun]:
    """Those that were asked for; each leaves a rule that was not trained."""
    asked: list[SmokeRun] = []

    def train(options: SmokeRun, _: object) -> None:
        asked.append(options)
        options.out.mkdir(parents=True, exist_ok=True)
        config = options.config
        rule = Rule.initial(config.rule, Scales(), seed=config.seed)
        Model(rule).save(options.out / MODEL_NAME)

    monkeypatch.setattr(study, "train", train)
    return asked


def test_studies_share_the_reference(make: Make, trainings: list[SmokeRun]) -> None:
    first, second = make(), make()
    first.trained("with_density", first.config, 0)
    second.trained("random_views", second.config, 0)
    assert [options.out.name.split("-")[0] for options in trainings] == [REFERENCE]


def test_a_copy_of_the_inputs_is_not_trained_on_again(
    make: Make, trainings: list[SmokeRun], tmp_path: Path
) -> None:
    one = make()
    other = make(frame=tmp_path / "copy.vdb")
    other.frame.write_bytes(one.frame.read_bytes())
    for each in (one, other):
        each.trained(REFERENCE, each.config, 0)
    assert len(trainings) == 1


@pytest.mark.parametrize("changed", ["frame", "style", "iterations", "size", "smoke", "seed"])
def test_a_run_of_something_else_is_not_taken_for_this_one(
    make: Make, trainings: list[SmokeRun], changed: str
) -> None:
    one = make()
    one.trained(REFERENCE, one.config, 0)
    other, seed = one, 0
    if changed in ("frame", "style"):
        getattr(one, changed).write_bytes(b"another")
    elif changed == "seed":
        seed = 1
    elif changed == "smoke":
        other = make(smoke=replace(one.smoke, fps=25.0))
    else:
        other = make(**{changed: 64})
    other.trained(REFERENCE, other.config, seed)
    assert len({options.out for options in trainings}) == 2


def test_a_training_that_was_interrupted_is_done_again(
    make: Make, trainings: list[SmokeRun]
) -> None:
    one = make()
    one.trained(REFERENCE, one.config, 0)
    (trainings[0].out / CHECKPOINT_NAME).touch()
    one.trained(REFERENCE, one.config, 0)
    assert len(trainings) == 2


def test_a_rule_is_trained_for_each_seed(make: Make, trainings: list[SmokeRun]) -> None:
    one = make(seeds=(3, 5))
    rules = dict(one.rules(REFERENCE, one.config))
    assert [*rules] == [options.config.seed for options in trainings] == [3, 5]


def test_full_is_the_preset_of_the_paper_on_a_gpu(make: Make) -> None:
    full = replace(make(full=True), iterations=None)
    assert (full.config.iterations, full.config.view.size) == (5000, 256)
    assert full.config.view.mode == "paper"


def test_a_study_without_seeds_is_refused() -> None:
    with pytest.raises(OptionError, match="--seeds"):
        Study(seeds=())


def test_a_missing_frame_is_named(make: Make, trainings: list[SmokeRun]) -> None:
    one = make(frame=Path("nowhere.vdb"))
    with pytest.raises(FileFormatError, match=r"nowhere\.vdb"):
        one.trained(REFERENCE, one.config, 0)


def test_a_table_has_mean_and_spread_over_seeds(make: Make) -> None:
    findings = Findings(make(), "a study")
    findings.add("white", {"L_app": 8})
    for seed, value in enumerate((2, 4)):
        findings.add("painted", {"L_app": value, "palette": 0.5}, seed=seed, on="front")
    assert table(findings.rows)[2:] == [
        "| white | 8 |  |",
        "| painted, front | 3 ± 1 | 0.5 ± 0 |",
    ]


def test_findings_of_several_studies_fit_in_one_table(make: Make, tmp_path: Path) -> None:
    path = tmp_path / "paper.csv"
    for name in ("density", "views"):
        findings = Findings(make(csv=path), name)
        findings.add("painted", {"L_app": 2.5}, seed=0)
        findings.tell()
    head, *rows = path.read_text().splitlines()
    assert len(rows) == 2
    assert head.endswith("variant,on,seed,measure,value")
    assert all(row.endswith("painted,,0,L_app,2.5") for row in rows)
