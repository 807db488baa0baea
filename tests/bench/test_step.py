from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from vnca.bench import contenders, onnx
from vnca.bench.step import (
    StepConfig,
    StepRun,
    measure_steps,
    needed_bytes,
    needed_flop,
    prepare,
)
from vnca.core import FloatArray
from vnca.core.errors import BackendUnavailableError, DisagreementError, OptionError, VncaError
from vnca.engine import native
from vnca.engine.native import BACKEND, bricks
from vnca.engine.reference import equations as reference
from vnca.engine.triton import step as triton

Make = Callable[..., StepConfig]
ALWAYS = ("plain", "reference")


def rows_of(config: StepConfig) -> list[dict[str, Any]]:
    prepare(config)
    return [row for run in measure_steps(config) for row in run.rows]


def test_every_backend_and_pass_gets_a_row_of_plausible_figures(small: Make) -> None:
    passes = ("forward", "backward", "both")
    config = small(backends=ALWAYS, passes=passes)
    facts = prepare(config)
    assert facts["device"]
    (run,) = measure_steps(config)
    assert isinstance(run, StepRun)
    assert [(r["backend"], r["pass"]) for r in run.rows] == [
        (name, part) for name in ALWAYS for part in passes
    ]
    for row in run.rows:
        assert row["grid"] == "12x8x9"
        assert row["hidden"] == 16
        assert 0 < row["occupancy"] < 1
        assert 0 < row["ns_per_cell_min"] <= row["ns_per_cell"] <= row["ns_per_cell_max"]
        assert row["gflops"] > 0
        assert 0 < row["share_of_peak"] < 1
        assert row["peak_gflops"] == pytest.approx(run.peak_gflops, abs=0.1)
        assert row["peak_mb"] is None or row["peak_mb"] >= 0


@pytest.mark.skipif(native.unavailable() is not None, reason="no native kernel")
def test_all_backends_there_are_take_part_unless_named(
    small: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(contenders, "_why_not_compiled", lambda device: "there is no compiler")
    found = {row["backend"] for row in rows_of(small(passes=("forward",), repeats=1))}
    assert {"plain", "reference", "native"} <= found
    assert "compile" not in found


def test_bfloat16_is_held_to_what_it_can_hold(small: Make) -> None:
    config = small(backends=ALWAYS, dtypes=("float32", "bfloat16"), repeats=1)
    assert {row["dtype"] for row in rows_of(config)} == {"float32", "bfloat16"}


@pytest.mark.skipif(native.unavailable() is not None, reason="no native kernel")
def test_the_native_kernel_takes_part_in_bfloat16_where_the_processor_has_it(small: Make) -> None:
    reason = native.unavailable("bfloat16")
    config = small(dtypes=("bfloat16",), backends=("native",), repeats=1)
    if reason is None:
        assert {row["dtype"] for row in rows_of(config)} == {"bfloat16"}
    else:
        with pytest.raises(BackendUnavailableError, match="bfloat16"):
            prepare(config)


def wrong_gradient(state: Tensor, *rest: Any) -> Tensor:
    result = reference.update(state, *rest)
    return result + 0.01 * (state - state.detach())


def test_nothing_is_timed_when_a_backend_computes_another_gradient(
    small: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(type(BACKEND), "update", lambda self, **options: wrong_gradient)
    monkeypatch.setattr("vnca.bench.step.measure", pytest.fail)
    with pytest.raises(DisagreementError, match="native: gradient of the state"):
        rows_of(small(backends=("plain", "native")))


@pytest.mark.skipif(native.unavailable() is not None, reason="no native kernel")
def test_nothing_is_timed_when_a_backend_computes_another_state(
    small: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    right = bricks.forward

    def wrong(state: FloatArray, *rest: Any, **options: Any) -> FloatArray:
        after = right(state, *rest, **options)
        return after + np.float32(1e-3) * (after - state)

    monkeypatch.setattr(bricks, "forward", wrong)
    monkeypatch.setattr("vnca.bench.step.measure", pytest.fail)
    with pytest.raises(DisagreementError, match="native: state"):
        rows_of(small(backends=("plain", "native")))


@pytest.mark.skipif(onnx.unavailable() is not None, reason="ONNX Runtime is not installed")
def test_onnx_runtime_agrees_and_is_timed_forward_only(small: Make) -> None:
    rows = rows_of(small(backends=("plain", "onnx")))
    assert [(row["backend"], row["pass"]) for row in rows] == [
        ("plain", "forward"),
        ("plain", "both"),
        ("onnx", "forward"),
    ]


def test_onnx_runtime_is_refused_where_it_is_not_compared(small: Make) -> None:
    with pytest.raises(BackendUnavailableError, match="onnx: "):
        prepare(small(backends=("onnx",), dtypes=("bfloat16",)))


def test_a_state_of_nothing_but_nan_is_a_disagreement(
    small: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(contenders, "plain_step", lambda grid, *rest: grid * torch.nan)
    with pytest.raises(DisagreementError, match="plain: state is off by nan"):
        rows_of(small(backends=("plain",), passes=("forward",)))


def test_work_is_counted_as_the_readme_derives_it() -> None:
    flop = needed_flop(128)
    assert (flop["forward"], flop["backward"], flop["both"]) == (20224, 38656, 58880)
    # 200×300×200 cells in half precision: 2.04 GB without the rows.
    assert needed_bytes(2)["forward"] * 12_000_000 == 2_040_000_000


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"grid": (4, 0, 4)}, OptionError),
        ({"hidden": 0}, OptionError),
        ({"occupancy": 1.5}, OptionError),
        ({"occupancy": float("nan")}, OptionError),
        ({"repeats": 0}, OptionError),
        ({"passes": ("up",)}, OptionError),
        ({"passes": ()}, OptionError),
        ({"dtypes": ("float8",)}, OptionError),
        ({"dtypes": ("tf32",)}, OptionError),
        ({"backends": ("nope",)}, OptionError),
        ({"backends": ("triton",)}, BackendUnavailableError),
    ],
)
def test_what_cannot_be_measured_is_refused(
    small: Make, monkeypatch: pytest.MonkeyPatch, options: dict[str, Any], error: type[VncaError]
) -> None:
    monkeypatch.setattr(triton, "_interpreted", False)  # other tests may have brought it up
    with pytest.raises(error):
        prepare(small(**options))


@pytest.mark.slow
def test_the_compiled_plain_step_agrees_and_is_timed(small: Make) -> None:
    names = [row["backend"] for row in rows_of(small(backends=("plain", "compile")))]
    assert names == ["plain", "plain", "compile", "compile"]
