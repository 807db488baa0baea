"""The border of the native kernel: what it is given is checked before it is used."""

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from vnca.core import AnyArray
from vnca.core.errors import ShapeError
from vnca.engine import native
from vnca.engine.automaton import stencil

CELLS, CHANNELS, HIDDEN, PRIORS = 50, 5, 7, 3

pytestmark = pytest.mark.skipif(
    native.unavailable() is not None, reason="the native kernel was not built"
)


@pytest.fixture
def arguments() -> dict[str, Any]:
    random = np.random.default_rng(0)

    def draw(*shape: int) -> AnyArray:
        return random.standard_normal(shape, np.float32)

    return {
        "state": draw(CELLS + 1, CHANNELS),
        "rows": np.arange(0, CELLS, 2, dtype=np.int32),
        "neighbours": random.integers(0, CELLS + 1, (27, CELLS), dtype=np.int32),
        "priors": draw(CELLS, PRIORS),
        "hidden": draw(HIDDEN, 5 * CHANNELS + PRIORS),
        "bias": draw(HIDDEN),
        "output": draw(CHANNELS, HIDDEN),
        "stencil": stencil(),
    }


def refused(words: str, arguments: dict[str, Any], **others: Any) -> None:
    with pytest.raises(ShapeError, match=words):
        native.forward(**{**arguments, **others})


def test_numbers_between_the_places_of_numbers_are_refused(arguments: dict[str, Any]) -> None:
    state = arguments["state"]
    data = np.frombuffer(b"x" + state.tobytes(), np.uint8)
    refused("state: expected aligned", arguments, state=data[1:].view("f4").reshape(state.shape))


def test_what_is_no_array_of_this_machine_is_refused(arguments: dict[str, Any]) -> None:
    refused("byte order", arguments, priors=arguments["priors"].astype(">f4"))
    refused("byte order", arguments, rows=[0, 1])
    refused("byte order", arguments, state=None)
    out = np.empty_like(arguments["state"])
    out.setflags(write=False)
    refused("writable", arguments, out=out)


@pytest.mark.parametrize("name", ["state", "rows", "neighbours", "priors", "hidden"])
def test_an_output_upon_an_input_is_refused(arguments: dict[str, Any], name: str) -> None:
    """Rows that change after they were checked could point anywhere."""
    array, size = arguments[name], arguments["state"].size
    memory = np.zeros(array.size + size, np.float32)
    place = memory.view(array.dtype)[: array.size].reshape(array.shape)
    place[...] = array
    behind, upon = (
        memory[start:][:size].reshape(arguments["state"].shape)
        for start in (array.size, array.size - 1)
    )
    native.forward(**{**arguments, name: place}, out=behind)
    refused("shares memory", {**arguments, name: place}, out=upon)


@pytest.mark.skipif(sys.platform != "linux", reason="memory is limited as Linux does it")
def test_memory_running_out_in_a_thread_is_an_error_and_not_the_end() -> None:
    script = Path(__file__).parents[1] / "out_of_memory.py"
    done = subprocess.run([sys.executable, script], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert {"there", "not there"} <= set(done.stdout.split("\n"))
