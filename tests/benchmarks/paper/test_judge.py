from dataclasses import replace

import numpy as np
import pytest
import torch
from judge import SIDES, UNPAINTED, Judge, magnified, paint
from study import Study

from vnca.core.colour import srgb_to_linear
from vnca.core.volume import Volume
from vnca.rendering.view import View
from vnca.rule import Rule, RuleConfig, Scales


@pytest.fixture(scope="module")
def judge() -> Judge:
    return Judge(Study(size=48))


@pytest.fixture(scope="module")
def rule() -> Rule:
    config = RuleConfig(channels=4, hidden=4, position_prior=False)
    return Rule.initial(config, Scales(gamma=20.0), seed=0)


def coloured(rule: Rule, shade: float) -> Rule:
    """A rule that brings all cells from grey to a shade of blue, and leaves the density."""
    hidden, output = np.zeros_like(rule.hidden), np.zeros_like(rule.output)
    hidden[0, 2], hidden[1, 2] = -1, 1  # what is missing of the shade, and what is too much
    bias = np.zeros_like(rule.bias)
    bias[:2] = shade - 0.5, 0.5 - shade
    output[2, :2] = 0.5, -0.5
    return replace(rule, hidden=hidden, bias=bias, output=output)


def test_finer_smoke_is_the_same_smoke(tiny_smoke: Volume) -> None:
    fine = magnified(tiny_smoke, 2)
    assert fine.density.shape == (24, 24, 24)
    assert fine.density.sum() == pytest.approx(8 * tiny_smoke.density.sum(), rel=0.01)
    assert fine.voxel_size == pytest.approx([0.05] * 3)
    assert fine.velocity is not None
    assert tiny_smoke.velocity is not None
    assert fine.velocity[11, 11, 11, 2] == pytest.approx(2 * tiny_smoke.velocity[5, 5, 5, 2])


def test_as_fine_a_grid_is_the_same_to_the_bit(tiny_smoke: Volume) -> None:
    same = magnified(tiny_smoke, 1)
    np.testing.assert_array_equal(same.density, tiny_smoke.density)
    np.testing.assert_array_equal(same.velocity, tiny_smoke.velocity)
    assert same.origin == tiny_smoke.origin


def test_unpainted_smoke_is_white_and_as_dense_as_it_was(tiny_smoke: Volume, rule: Rule) -> None:
    painting = paint(coloured(rule, 0.9), tiny_smoke, UNPAINTED)
    np.testing.assert_array_equal(painting.density, tiny_smoke.density)
    assert (painting.colour == 1).all()


def test_a_preview_shows_what_is_painted(judge: Judge, tiny_smoke: Volume, rule: Rule) -> None:
    blue = coloured(rule, 0.9)
    preview_view = judge.preview_view(paint(blue, tiny_smoke), blue)
    middle = preview_view[len(preview_view) // 2, len(preview_view) // 2]
    expected = srgb_to_linear(np.array([0.5, 0.5, 0.9]))
    np.testing.assert_allclose(middle, expected, atol=0.01)
    assert preview_view[0, 0].max() < 0.02


def test_more_extinction_is_more_opaque(judge: Judge, tiny_smoke: Volume, rule: Rule) -> None:
    painting = paint(rule, tiny_smoke)
    thin, thick = (
        judge.look(painting, rule, SIDES["front"], gamma=gamma).opacity.mean()
        for gamma in (0.001, 1.0)
    )
    assert thin < 0.5 * thick


def test_the_picture_itself_is_nearest_to_the_picture(judge: Judge) -> None:
    picture = torch.from_numpy(judge.style).permute(2, 0, 1)[None]
    picture = torch.nn.functional.interpolate(picture, (48, 48), mode="area")[0].permute(1, 2, 0)
    opaque, depth = torch.ones(48, 48), torch.ones(48, 48)
    grey = torch.full_like(picture, 0.2)
    itself, other = (judge.distance([View(seen, opaque, depth)]) for seen in (picture, grey))
    assert itself["L_app"] < 0.5 * other["L_app"]
    assert itself["palette"] < 0.5 * other["palette"]


def test_judging_again_gives_the_same(judge: Judge, tiny_smoke: Volume, rule: Rule) -> None:
    painting = paint(coloured(rule, 0.7), tiny_smoke)
    assert judge.around(painting, rule) == judge.around(painting, rule)


def test_a_sheet_has_a_row_for_each_kind(judge: Judge) -> None:
    picture = np.zeros((192, 192, 3), np.float32)
    one, two = (
        judge.sheet(rows)
        for rows in ({"a": {"c": picture}}, {"a": {"c": picture}, "b": {"c": picture}})
    )
    assert two.shape[0] > 1.8 * one.shape[0]
    assert two.shape[1] == one.shape[1]
