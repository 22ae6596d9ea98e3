"""How does an actor get out of here? As ONNX for other runtimes, and the proof that it says the same there.

The graph is the actor of ``companion.policy``: Gemm and Relu, and for actions a Tanh at the end; float32, any number of
observations at once.
"""

from pathlib import Path

import numpy as np
import onnx
from onnx import TensorProto, helper, numpy_helper
from onnx.reference import ReferenceEvaluator

from companion.core.types import F64
from companion.policy.actor import Actor, squashed
from companion.policy.store import read_policy
from mission.errors import FlightError
from mission.training.checkpoint import write_whole

OPSET = 17
IR_VERSION = 8  # of the year of that opset: old runtimes read it
INPUT = "observation"
PARITY = 1e-5  # largest difference of an output of order one that float32 explains
PROBES = 256


def export_onnx(folder: Path, path: Path) -> float:
    """Write the policy in ``folder`` as ONNX to ``path``; the largest difference to it over random observations.

    Raises PolicyError for a policy that may not fly, FlightError where the two differ or the disk does not take it.
    """
    card, actor = read_policy(folder)
    model = graph(actor, card.spec.head == "continuous", card.name)
    difference = parity(actor, model)
    if not difference <= PARITY:
        raise FlightError(f"{path}: ONNX differs from {folder} by {difference:.2g}, expected {PARITY:g} at most")
    try:
        write_whole(path, model.SerializeToString())
    except OSError as error:
        raise FlightError(f"{path}: {error.strerror or error}") from error
    return difference


def graph(actor: Actor, squash: bool, name: str) -> onnx.ModelProto:
    """The actor as an ONNX model from ``observation`` to ``action`` (squashed) or ``logits``."""
    output = "action" if squash else "logits"
    nodes, constants, here = [], [], INPUT
    last = len(actor.weights) - 1
    for k, (weight, bias) in enumerate(zip(actor.weights, actor.biases, strict=True)):
        constants += [numpy_helper.from_array(weight, f"weight{k}"), numpy_helper.from_array(bias, f"bias{k}")]
        there = output if k == last and not squash else f"layer{k}"
        nodes.append(helper.make_node("Gemm", [here, f"weight{k}", f"bias{k}"], [there], transB=1))
        here = there
        if k < last:
            nodes.append(helper.make_node("Relu", [here], [f"relu{k}"]))
            here = f"relu{k}"
    if squash:
        nodes.append(helper.make_node("Tanh", [here], [output]))
    sizes = actor.sizes()
    inputs = [helper.make_tensor_value_info(INPUT, TensorProto.FLOAT, ["n", sizes[0]])]
    outputs = [helper.make_tensor_value_info(output, TensorProto.FLOAT, ["n", sizes[-1]])]
    model = helper.make_model(
        helper.make_graph(nodes, name, inputs, outputs, constants),
        opset_imports=[helper.make_opsetid("", OPSET)],
        ir_version=IR_VERSION,
        producer_name="swiftnav",
    )
    onnx.checker.check_model(model, full_check=True)
    return model


def parity(actor: Actor, model: onnx.ModelProto, seed: int = 0) -> float:
    """Largest difference between the model, run by ONNX's own evaluator, and the actor as it flies."""
    observations = np.random.default_rng(seed).normal(size=(PROBES, actor.sizes()[0]))
    said = ReferenceEvaluator(model).run(None, {INPUT: observations.astype(np.float32)})[0]
    expected: F64 = actor.forward(observations)
    if model.graph.output[0].name == "action":
        expected = squashed(expected)
    return float(np.abs(said - expected).max())
