import numpy as np
import pytest

from vnca.colour import linear_to_srgb, luminance, rec709_from, srgb_to_linear


def test_known_codes_decode_to_the_standard_values() -> None:
    # IEC 61966-2-1: code 128 is 0.2159 of full light, code 10 is on the linear piece.
    assert srgb_to_linear(128 / 255) == pytest.approx(0.2158605, abs=1e-6)
    assert srgb_to_linear(10 / 255) == pytest.approx(10 / 255 / 12.92)
    assert srgb_to_linear([0.0, 1.0]) == pytest.approx([0, 1])


def test_encoding_undoes_decoding_also_out_of_range() -> None:
    value = np.linspace(-1, 4, 5001)
    np.testing.assert_allclose(linear_to_srgb(srgb_to_linear(value)), value, atol=2e-7)


def test_curves_rise_without_a_jump() -> None:
    for curve in (srgb_to_linear, linear_to_srgb):
        rise = np.diff(curve(np.linspace(-1, 4, 500_001)))
        assert rise.min() > 0
        assert rise.max() < 20e-5


def test_single_precision_stays_single() -> None:
    value = np.zeros((2, 3), np.float32)
    assert srgb_to_linear(value).dtype == np.float32
    assert linear_to_srgb(value).dtype == np.float32
    assert luminance(value).dtype == np.float32


def test_white_has_luminance_one_and_green_is_brightest() -> None:
    assert luminance([1.0, 1.0, 1.0]) == pytest.approx(1)
    assert luminance(np.eye(3)).argmax() == 1


def test_the_primaries_of_rec709_change_nothing() -> None:
    ours = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
    np.testing.assert_allclose(rec709_from(ours), np.eye(3), atol=1e-12)


def test_acescg_is_converted_as_the_field_does() -> None:
    """By the matrix that is commonly published, with Bradford adaptation, to four digits."""
    acescg = (0.713, 0.293, 0.165, 0.830, 0.128, 0.044, 0.32168, 0.33767)
    expected = [[1.7051, -0.6218, -0.0833], [-0.1303, 1.1408, -0.0105], [-0.0240, -0.1290, 1.1530]]
    np.testing.assert_allclose(rec709_from(acescg), expected, atol=1e-4)
    np.testing.assert_allclose(rec709_from(acescg).sum(1), 1, atol=1e-9)


@pytest.mark.parametrize("primaries", [(0.0,) * 8, (0.3, 0.3) * 4, (np.nan,) * 8])
def test_primaries_of_which_no_colours_can_be_made_are_refused(primaries: tuple) -> None:
    with pytest.raises(ValueError, match="no colours"):
        rec709_from(primaries)
