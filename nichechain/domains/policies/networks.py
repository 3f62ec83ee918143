"""Policies of the domains that have one: a torch module, or a short text that names a network."""

from __future__ import annotations

from typing import TYPE_CHECKING

from nichechain.core.checks import shown
from nichechain.core.errors import NichechainError
from nichechain.domains.policies.controllers import MLP, Controller, ModuleController

if TYPE_CHECKING:
    from torch import nn

_HIDDEN = {"mlp": "relu", "mlp-tanh": "tanh"}


def network(
    controller: nn.Module | str,
    inputs: int,
    outputs: int,
    *,
    output: str = "tanh",
    evolve_biases: bool = False,
) -> Controller:
    """A policy of a domain.

    Parameters
    ----------
    controller : torch.nn.Module or str
        A module, or a text such as ``mlp:64,64``, two hidden layers of 64 units each with ReLU;
        ``mlp-tanh:64,64`` has tanh instead, and ``mlp:`` no hidden layer.
    inputs, outputs : int
        Length of an observation and of an action.
    output : {"relu", "tanh", "identity"}
        Activation of the output of a network named by a text.
    evolve_biases : bool
        Whether biases of a stack of linear layers evolve, or stay 0.

    Raises
    ------
    NichechainError
        If the text names no network, or the controller does not fit.
    """
    if isinstance(controller, str):
        kind, colon, layers = controller.partition(":")
        units = [word.strip() for word in layers.split(",")] if layers else []
        if kind not in _HIDDEN or not colon or not all(u.isdecimal() and u.isascii() for u in units):
            raise NichechainError(
                f"controller is {shown(controller)}, but must be mlp:UNITS,UNITS or mlp-tanh:UNITS,UNITS"
            )
        return MLP((inputs, *map(int, units), outputs), _HIDDEN[kind], output, evolve_biases)
    if not hasattr(controller, "parameters"):
        raise NichechainError(
            f"controller is {shown(controller)}, but must be a torch.nn.Module or a text such as mlp:64,64"
        )
    made = MLP.of(controller, evolve_biases=evolve_biases) or ModuleController(controller, inputs, outputs)
    if (made.inputs, made.outputs) != (inputs, outputs):
        raise NichechainError(
            f"the controller goes from {made.inputs} to {made.outputs} units, "
            f"but must go from {inputs} to {outputs}"
        )
    return made
