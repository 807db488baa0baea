"""The plain step as a session of ONNX Runtime, as one gets who exports a rule; forward only."""

from collections.abc import Callable
from importlib.util import find_spec

import numpy as np

from vnca.core import AnyArray, FloatArray

OPSET, IR_VERSION = 18, 9
"""Versions of operators and of the format that ONNX Runtime 1.17 reads, and all since."""


def unavailable() -> str | None:
    """What is missing here, or nothing."""
    missing = [name for name in ("onnx", "onnxruntime") if find_spec(name) is None]
    return f"{' and '.join(missing)} not installed" if missing else None


def onnx_step(
    mask: FloatArray,
    priors: FloatArray,
    filters: FloatArray,
    hidden: FloatArray,
    bias: FloatArray,
    output: FloatArray,
    *,
    threads: int,
) -> Callable[[AnyArray], FloatArray]:
    """The step of `vnca.bench.plain.plain_step` from a state `[1, C, x, y, z]` to the next.

    All but the state is part of the model, so that the runtime can prepare it.

    Args:
        mask: `[1, 1, x, y, z]`.
        priors: `[1, P, x, y, z]`.
        filters: `[4C, 1, 3, 3, 3]`.
        hidden: W1 `[H, 5C + P, 1, 1, 1]`.
        bias: b1 `[H]`.
        output: W2 `[C, H, 1, 1, 1]`.
        threads: How many the runtime uses.
    """
    import onnxruntime
    from onnx import TensorProto, helper, numpy_helper

    shape = [1, len(output), *mask.shape[2:]]
    given = {
        "mask": mask,
        "priors": priors,
        "filters": filters,
        "hidden": hidden,
        "bias": bias,
        "output": output,
        "pads": np.array([0, 0, 1, 1, 1, 0, 0, 1, 1, 1], np.int64),
    }
    node = helper.make_node
    nodes = [
        node("Pad", ["state", "pads"], ["padded"], mode="edge"),
        node("Conv", ["padded", "filters"], ["filtered"], group=shape[1]),
        node("Concat", ["state", "filtered", "priors"], ["z"], axis=1),
        node("Conv", ["z", "hidden", "bias"], ["before"]),
        node("Relu", ["before"], ["units"]),
        node("Conv", ["units", "output"], ["change"]),
        node("Mul", ["mask", "change"], ["masked"]),
        node("Add", ["state", "masked"], ["after"]),
    ]
    before, after = (
        [helper.make_tensor_value_info(name, TensorProto.FLOAT, shape)]
        for name in ("state", "after")
    )
    constants = [numpy_helper.from_array(array, name) for name, array in given.items()]
    model = helper.make_model(
        helper.make_graph(nodes, "step", before, after, constants),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
    )
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    session = onnxruntime.InferenceSession(
        model.SerializeToString(), options, providers=["CPUExecutionProvider"]
    )
    return lambda state: np.asarray(session.run(["after"], {"state": state})[0])
