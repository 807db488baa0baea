from dataclasses import replace

import numpy as np
import pytest

from vnca.core.errors import ShapeError
from vnca.engine.automaton import DecoderWeights
from vnca.rule import Decoder, Rule, RuleConfig, Scales
from vnca.rule.paint import Between


def test_a_decoder_before_training_is_drawn_from_its_seed() -> None:
    one, same, other = (Decoder.initial(12, seed=seed) for seed in (1, 1, 2))
    for a, b, shape in zip(one.weights, same.weights, DecoderWeights.shapes(12, 32), strict=True):
        assert a.dtype == np.float32
        assert a.shape == shape
        assert a.tobytes() == b.tobytes()
    assert (one.weights.first != other.weights.first).any()
    assert one.channels == 12
    assert one.weight_count == 13 * 32 + 2 * 33 * 32 + 33 * 4


def test_a_higher_frequency_draws_finer_contours() -> None:
    rule = Rule.initial(RuleConfig(hidden=1), Scales(), seed=0)
    state = np.zeros((3, 12), np.float32)
    state[:2] = np.random.default_rng(0).uniform(-0.5, 0.5, (2, 12))
    rows = np.array([[0]] * 4 + [[1]] * 4, np.int32).repeat(500, axis=1)
    fractions = np.zeros((500, 3), np.float32)
    fractions[:, 0] = np.linspace(0, 1, 500)
    plain = Between(rule).at(state, rows, fractions)

    def turns(frequency: float) -> int:
        """How often what decoders add turns, on the way from one cell to the next."""
        total = 0
        for seed in range(8):
            decoder = Decoder.initial(12, seed=seed, frequency=frequency)
            seen = Between(replace(rule, decoder=decoder)).at(state, rows, fractions)
            added = (seen - plain)[:, :3]
            slope = np.diff(added.astype(np.float64), axis=0)
            total += int((slope[1:] * slope[:-1] < 0).sum())
        return total

    assert turns(40) > 2 * turns(10) > 0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"third": np.zeros((32, 31), np.float32)}, "'third': .* fits no network"),
        ({"output": np.zeros((3, 32), np.float32)}, "'output': .* fits no network"),
        ({"first": np.zeros(32, np.float32)}, "'first': .* fits no network"),
        ({"first": np.zeros((0, 12), np.float32)}, "'first': .* fits no network"),
        ({"second_bias": np.full(32, np.nan, np.float32)}, "'second_bias': not all finite"),
    ],
)
def test_weights_that_are_no_decoder_are_refused(change: dict[str, object], words: str) -> None:
    weights = Decoder.initial(12, seed=0).weights
    with pytest.raises(ShapeError, match=words):
        Decoder(weights._replace(**change))


def test_a_decoder_of_other_states_is_refused() -> None:
    rule = Rule.initial(RuleConfig(channels=12, hidden=3), Scales(), seed=0)
    arrays = {"hidden": rule.hidden, "bias": rule.bias, "output": rule.output}
    with pytest.raises(ShapeError, match="expected 12 channels as the rule has, got 11"):
        Rule(**arrays, config=rule.config, decoder=Decoder.initial(11, seed=0))


def test_the_weights_of_a_decoder_count() -> None:
    rule = Rule.initial(RuleConfig(channels=12, hidden=3), Scales(), seed=0)
    arrays = {"hidden": rule.hidden, "bias": rule.bias, "output": rule.output}
    decoder = Decoder.initial(12, seed=0, units=8)
    whole = Rule(**arrays, config=rule.config, decoder=decoder)
    assert whole.weight_count == rule.weight_count + decoder.weight_count
    assert whole.refined(2).decoder is decoder
