"""Rules between others of the same origin."""

from dataclasses import replace

import numpy as np
import pytest

from vnca.core.errors import OptionError
from vnca.rule import Decoder, Rule, RuleConfig, Scales
from vnca.rule.mixing import ORIGINS, blended, origin, origins, require_blendable
from vnca.rule.model import Model

CONFIG = RuleConfig(channels=5, hidden=7)


def rule(seed: int, *, units: int = 6) -> Rule:
    plain = Rule.initial(CONFIG, Scales(gamma=seed + 1), seed=seed)
    return replace(plain, decoder=Decoder.initial(5, units=units, seed=seed) if units else None)


def model(seed: int, *earlier: str) -> Model:
    return Model(rule(seed), {ORIGINS: [*earlier]})


def arrays(rule: Rule) -> list[np.ndarray]:
    assert rule.decoder is not None
    return [rule.hidden, rule.bias, rule.output, *rule.decoder.weights]


def test_a_rule_between_others_has_weights_between_theirs() -> None:
    one, two = rule(0), rule(1)
    both = blended((one, two), np.array([0.75, 0.25], np.float32))
    for first, second, between in zip(*map(arrays, (one, two, both)), strict=True):
        np.testing.assert_allclose(between, 0.75 * first + 0.25 * second, atol=1e-6)
    assert both.scales == one.scales


def test_at_either_end_it_is_that_rule_to_the_bit() -> None:
    rules = rule(0), rule(1)
    for number, ours in enumerate(rules):
        end = blended(rules, np.eye(2, dtype=np.float32)[number])
        for theirs, weights in zip(arrays(end), arrays(ours), strict=True):
            np.testing.assert_array_equal(theirs, weights)


def test_what_conditioning_meets_is_no_part_of_an_origin() -> None:
    ours = rule(0)
    hidden = ours.hidden.copy()
    hidden[:, -7:] = 0
    assert origin(replace(ours, hidden=hidden)) == origin(ours)
    hidden[0, 0] += 1
    assert origin(replace(ours, hidden=hidden)) != origin(ours)


def test_models_are_mixed_that_come_from_the_same_texture() -> None:
    texture = model(9, "its graft")
    one, two = model(0, *origins(texture)), model(1, *origins(texture))
    require_blendable(one, two, "`blend` two")
    require_blendable(one, texture, "`blend` texture")
    require_blendable(model(3, "its graft"), one, "`blend` one")


def test_others_are_refused_in_a_line() -> None:
    with pytest.raises(OptionError, match="`blend` b: does not tell that it began with the same"):
        require_blendable(model(0), model(1), "`blend` b")
    with pytest.raises(OptionError, match="`blend` b: does not tell"):
        require_blendable(model(0, "this"), model(1, "that"), "`blend` b")
    other = Rule.initial(RuleConfig(channels=5, hidden=8), Scales(), seed=0)
    with pytest.raises(OptionError, match="shaped otherwise than the first, in `hidden`"):
        require_blendable(model(0, "x"), Model(other, {ORIGINS: ["x"]}), "`blend` b")
    with pytest.raises(OptionError, match="in `decoder`"):
        require_blendable(model(0, "x"), Model(rule(1, units=0), {ORIGINS: ["x"]}), "`blend` b")
