"""Trainings that start from a rule which was trained before."""

from pathlib import Path

from vnca.core.colour import linear_to_srgb
from vnca.core.errors import OptionError
from vnca.core.typing import FloatArray
from vnca.core.watch import Watch
from vnca.rule.library import load_style, nearest_style, style_names
from vnca.rule.model import Model
from vnca.rule.rule import Rule
from vnca.training.loop import Trainer
from vnca.training.pretraining import AUTO, SHAPE, without_prior_weights


def rule_to_go_on_with(path: Path, wanted: Rule) -> Rule:
    """The rule of a model that a training on smoke begins with.

    A rule of smoke keeps what it has learnt of priors; a texture has had none.

    Args:
        path: Of the model, or of the folder of its run.
        wanted: What its weights are to fit.

    Raises:
        VncaError: If it cannot be read, or is a rule of another shape.
    """
    rule = Model.load(path).rule
    misfit = _misfit(rule, wanted)
    if misfit is not None:
        raise OptionError(f"`init` {path}: {misfit}")
    its = rule.config
    knows_smoke = any(its.is_conditioned_on(name) for name in its.conditioning)
    if knows_smoke and its.conditioning == wanted.config.conditioning:
        return rule
    return without_prior_weights(rule, wanted.config.conditioning)


def _misfit(rule: Rule, wanted: Rule) -> str | None:
    """In what a rule is shaped otherwise than another, if it is."""
    for name in SHAPE:
        its, ours = (getattr(r.config, name) for r in (rule, wanted))
        if its != ours:
            return f"was trained with `{name}` {its:g}; add that, in place of {ours:g}"
    its, ours = (r.decoder.units if r.decoder is not None else 0 for r in (rule, wanted))
    if its != ours:
        return f"was trained with `decoder` {its}; add that, in place of {ours}"
    return None


def graft(
    trainer: Trainer, source: str, style: FloatArray, watch: Watch, *, goes_on: bool
) -> str | None:
    """Let a training of a texture start from the rule of another picture.

    Args:
        trainer: Before its first iteration.
        source: As of `TrainingConfig.graft`.
        style: Linear RGB `[r, c, 3]`, to find the nearest style by.
        watch: Is told what it starts from.
        goes_on: Whether it has started already, and only the name is wanted.

    Returns:
        The name of the rule; None if it starts from nothing.

    Raises:
        VncaError: If the rule asked for cannot be read, or is of another shape.
    """
    wanted = trainer.rule()
    if source == "none":
        return None
    if source in (AUTO, *style_names()):
        is_auto = source == AUTO
        name = nearest_style(linear_to_srgb(style.clip(0, 1))) if is_auto else source
        rule = load_style(name).rule
        misfit = _misfit(rule, wanted)
        if is_auto and misfit is not None:
            watch.note("no style of the library has such a rule; training starts from nothing")
            return None
        what = f"`graft` {name}"
    else:
        rule, name = Model.load(Path(source)).rule, Path(source).name
        misfit, what = _misfit(rule, wanted), f"`graft` {source}"
    if misfit is not None:
        raise OptionError(f"{what}: {misfit}")
    if not goes_on:
        watch.note(f"starting from the rule of {name}")
        trainer.begin_with(without_prior_weights(rule, wanted.config.conditioning))
    return name
