"""The policy of :meth:`nichechain.domains.policies.controllers.MLP.actions`, compiled; the same bits."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from nichechain.core.compiled import compiled
from nichechain.domains.policies.controllers import (
    EXP_TERMS,
    INVERSE_LN2,
    LN2_HIGH,
    LN2_LOW,
    RELU,
    TANH,
    TANH_LINEAR,
    TANH_SATURATED,
)


@compiled
def _tanh(value: Any) -> Any:
    """One value of :func:`nichechain.domains.policies.controllers.tanh`, operation by operation."""
    size = abs(np.float64(value))
    if size < TANH_LINEAR or size != size:
        return value
    doubled = 2.0 * min(size, TANH_SATURATED)
    k = math.floor(doubled * INVERSE_LN2 + 0.5)
    r = (doubled - k * LN2_HIGH) - k * LN2_LOW
    series = 1.0
    for n in range(EXP_TERMS, 0, -1):
        series = 1.0 + series * r / n
    power = math.ldexp(series, int(k))
    return np.float32(math.copysign(1.0 - 2.0 / (power + 1.0), value))


@compiled
def forward(
    parameters: Any, sizes: Any, activations: Any, hidden: Any, observation: Any, action: Any
) -> None:
    """Write the policy's action for one observation.

    Parameters
    ----------
    parameters : (P,) float32
        For each layer its weights (outputs, inputs), row after row, then its biases.
    sizes : (layers + 1,) int64
        Units of the input and of every layer.
    activations : (layers,) int64
        Codes of :mod:`nichechain.domains.policies.controllers`.
    hidden : (2, max(sizes)) float32
        Working memory.
    observation : (sizes[0],) float64
        Rounded to float32 before anything else.
    action : (sizes[-1],) float32
        Written.
    """
    for j in range(sizes[0]):
        hidden[0, j] = np.float32(observation[j])
    start = 0
    source = 0
    for layer in range(activations.size):
        inputs, outputs = sizes[layer], sizes[layer + 1]
        biases = start + outputs * inputs
        for i in range(outputs):
            total = parameters[biases + i]
            row = start + i * inputs
            for j in range(inputs):
                total += parameters[row + j] * hidden[source, j]
            if activations[layer] == RELU:
                total = max(total, np.float32(0.0))
            elif activations[layer] == TANH:
                total = _tanh(total)
            hidden[1 - source, i] = total
        start = biases + outputs
        source = 1 - source
    for i in range(sizes[-1]):
        action[i] = hidden[source, i]
