"""Neural-network controllers: flat genotypes and torch modules, one into the other."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from nichechain.core.checks import (
    as_floats,
    as_tuple,
    check_choice,
    check_sample,
    check_whole,
    rng_of,
)
from nichechain.core.errors import NichechainError

if TYPE_CHECKING:
    from torch import nn

Float32s = NDArray[np.float32]
Policy: TypeAlias = Callable[[ArrayLike], Float32s]
"""From an observation to an action."""

IDENTITY, RELU, TANH = 0, 1, 2
_ACTIVATIONS = {"identity": IDENTITY, "relu": RELU, "tanh": TANH}


# ln 2 in two parts: the first has so few digits that its product with a small integer is exact.
LN2_HIGH = 6.93147180369123816490e-01
LN2_LOW = 1.90821492927058770002e-10
INVERSE_LN2 = 1.4426950408889634
# Below, the cubic term of tanh is under half a unit in the last place of a float32; above, 1 is
# the nearest float32.
TANH_LINEAR, TANH_SATURATED = 1e-4, 9.5
EXP_TERMS = 11


def tanh(values: Float32s) -> Float32s:
    """Hyperbolic tangent in float32, made of operations that IEEE 754 rounds in one way only.

    Maths libraries and vector units differ in the last bit of tanh; this does not, so archives
    replay to the bit on another machine. In error by at most one unit in the last place.

    Parameters
    ----------
    values : float32 array

    Returns
    -------
    float32 array of the same shape
    """
    size = np.abs(values.astype(np.float64))
    doubled = 2.0 * np.minimum(size, TANH_SATURATED)
    # e^doubled = 2^k e^r with |r| <= ln(2)/2, where eleven terms of the series leave 1e-14.
    k = np.floor(doubled * INVERSE_LN2 + 0.5)
    r = (doubled - k * LN2_HIGH) - k * LN2_LOW
    series = np.ones_like(r)
    for n in range(EXP_TERMS, 0, -1):
        series = 1.0 + series * r / n
    power = np.ldexp(series, np.nan_to_num(k).astype(np.int64))
    result = np.copysign(1.0 - 2.0 / (power + 1.0), values).astype(np.float32)
    return np.where(size < TANH_LINEAR, values, result)


class Controller(Protocol):
    """A network that flat genotypes hold the parameters of."""

    @property
    def inputs(self) -> int:
        """Length of an observation."""
        ...

    @property
    def outputs(self) -> int:
        """Length of an action."""
        ...

    @property
    def genotype_length(self) -> int:
        """Number of evolved parameters."""
        ...

    def sample(self, n: int, seed: int | np.random.Generator) -> Float32s:
        """Initial genotypes, (n, genotype_length)."""
        ...

    def policy(self, genotype: ArrayLike) -> Policy:
        """From observations (N, inputs) to actions (N, outputs); a row's bits are its own."""
        ...

    def module(self, genotype: ArrayLike) -> nn.Module:
        """The controller as a torch module, with the genotype's parameters."""
        ...


@dataclass(frozen=True)
class MLP:
    """A fully connected network and the layout of its genotype.

    Parameters
    ----------
    sizes : tuple of int
        Units of the input, of every hidden layer and of the output.
    hidden : {"relu", "tanh", "identity"} or tuple of them
        Activation of the hidden layers, or of each of them.
    output : {"relu", "tanh", "identity"}
        Activation of the output.
    evolve_biases : bool
        Whether biases are part of the genotype. By default they stay 0: the paper starts them
        there and says that "only the weights are updated".

    Notes
    -----
    A genotype is float32. It holds, layer after layer, the weight matrix (outputs, inputs) in C
    order, followed by the biases if they evolve: the order of ``module.parameters()``.
    """

    sizes: tuple[int, ...] = (25, 32, 32, 4)
    hidden: str | tuple[str, ...] = "relu"
    output: str = "tanh"
    evolve_biases: bool = False

    def __post_init__(self) -> None:
        object.__setattr__(self, "sizes", as_tuple("layer sizes", self.sizes))
        for size in self.sizes:
            check_whole(layer_size=size)
        if len(self.sizes) < 2 or min(self.sizes) < 1:
            raise NichechainError(f"layer sizes are {self.sizes}, but two or more positive ones are needed")
        if not isinstance(self.hidden, str):
            object.__setattr__(self, "hidden", as_tuple("hidden", self.hidden))
        if not isinstance(self.hidden, str) and len(self.hidden) != len(self.sizes) - 2:
            raise NichechainError(
                f"hidden has {len(self.hidden)} activations, "
                f"but there are {len(self.sizes) - 2} hidden layers"
            )
        for name in self._names:
            check_choice("activation", name, _ACTIVATIONS)

    @classmethod
    def of(cls, module: nn.Module, *, evolve_biases: bool = False) -> MLP | None:
        """The layout of a stack of linear layers with ReLU or tanh; None for any other module.

        Parameters
        ----------
        module : torch.nn.Module
            Only its architecture matters, not its parameters.
        evolve_biases : bool
        """
        from torch import nn

        names = {nn.ReLU: "relu", nn.Tanh: "tanh", nn.Identity: "identity"}
        sizes: list[int] = []
        activations: list[str] = []
        for layer in module if isinstance(module, nn.Sequential) else [module]:
            if isinstance(layer, nn.Linear) and layer.bias is not None:
                sizes += [layer.in_features] if not sizes else []
                sizes.append(layer.out_features)
                activations.append("identity")
            elif type(layer) in names and activations and activations[-1] == "identity":
                activations[-1] = names[type(layer)]
            else:
                return None
        if len(sizes) < 2:
            return None
        return cls(tuple(sizes), tuple(activations[:-1]), activations[-1], evolve_biases)

    @property
    def _names(self) -> tuple[str, ...]:
        """Activation of every layer."""
        hidden = (self.hidden,) * (len(self.sizes) - 2) if isinstance(self.hidden, str) else self.hidden
        return (*hidden, self.output)

    @property
    def inputs(self) -> int:
        """Length of an observation."""
        return self.sizes[0]

    @property
    def outputs(self) -> int:
        """Length of an action."""
        return self.sizes[-1]

    @property
    def genotype_length(self) -> int:
        """Number of evolved parameters."""
        weights = sum(a * b for a, b in zip(self.sizes, self.sizes[1:], strict=False))
        return weights + (sum(self.sizes[1:]) if self.evolve_biases else 0)

    @property
    def layers(self) -> tuple[int, ...]:
        """Evolved parameters of each layer."""
        pairs = zip(self.sizes, self.sizes[1:], strict=False)
        return tuple((inputs + self.evolve_biases) * outputs for inputs, outputs in pairs)

    @property
    def activations(self) -> NDArray[np.int64]:
        """Activation code of every layer."""
        return np.array([_ACTIVATIONS[name] for name in self._names], np.int64)

    def parameters(self, genotype: ArrayLike) -> Float32s:
        """All weights and biases, flat: the genotype with the fixed biases put in.

        Raises
        ------
        NichechainError
            If the genotype has the wrong length.
        """
        flat = np.ascontiguousarray(as_floats("genotype", genotype), np.float32)
        if flat.shape != (self.genotype_length,):
            raise NichechainError(
                f"genotype has shape {flat.shape}, but this controller's has ({self.genotype_length},)"
            )
        if self.evolve_biases:
            return flat
        parts = []
        start = 0
        for inputs, outputs in zip(self.sizes, self.sizes[1:], strict=False):
            parts += [flat[start : start + inputs * outputs], np.zeros(outputs, np.float32)]
            start += inputs * outputs
        return np.concatenate(parts)

    def actions(self, genotype: ArrayLike, observations: ArrayLike) -> Float32s:
        """Actions of the controller for a batch of observations.

        Parameters
        ----------
        genotype : (genotype_length,) array
        observations : (N, sizes[0]) array
            Rounded to float32 before anything else.

        Returns
        -------
        (N, sizes[-1]) float32 array

        Notes
        -----
        Every sum runs over the inputs in order and :func:`tanh` is made of basic operations, so
        a row's bits depend on neither the batch nor the machine, and the native engine has the
        same. The torch module of :meth:`module` sums in another order: equal up to rounding.
        """
        units = as_floats("observations", observations).astype(np.float32)
        if units.ndim != 2 or units.shape[1] != self.sizes[0]:
            raise NichechainError(f"observations have shape {units.shape}, but must be (N, {self.sizes[0]})")
        flat = self.parameters(genotype)
        start = 0
        for code, inputs, outputs in zip(self.activations, self.sizes, self.sizes[1:], strict=False):
            weight = flat[start : start + outputs * inputs].reshape(outputs, inputs)
            start += outputs * inputs
            total = np.repeat(flat[None, start : start + outputs], len(units), axis=0)
            start += outputs
            for j in range(inputs):
                total += weight[:, j] * units[:, j : j + 1]
            units = np.maximum(total, 0) if code == RELU else tanh(total) if code == TANH else total
        return units

    def policy(self, genotype: ArrayLike) -> Policy:
        """:meth:`actions` of one genotype."""
        return partial(self.actions, genotype)

    def sample(self, n: int, seed: int | np.random.Generator) -> Float32s:
        """Genotypes with Xavier normal weights and biases 0.

        Drawn one after another, so the first k of n are the k that ``sample(k, seed)`` gives.

        Parameters
        ----------
        n : int
            Number of genotypes.
        seed : int or numpy.random.Generator

        Returns
        -------
        (n, genotype_length) float32 array
        """
        import torch

        n = check_sample(n, self.genotype_length)
        generator = torch.Generator().manual_seed(int(rng_of(seed).integers(2**63)))
        genotypes = np.empty((n, self.genotype_length), np.float32)
        for row in genotypes:
            start = 0
            for inputs, outputs in zip(self.sizes, self.sizes[1:], strict=False):
                weight = torch.empty(outputs, inputs)
                torch.nn.init.xavier_normal_(weight, generator=generator)
                row[start : start + inputs * outputs] = weight.numpy().ravel()
                start += inputs * outputs
                if self.evolve_biases:
                    row[start : start + outputs] = 0.0
                    start += outputs
        return genotypes

    def module(self, genotype: ArrayLike) -> nn.Sequential:
        """The controller as a torch module, with the genotype's weights."""
        import torch
        from torch import nn

        modules: dict[str, Any] = {"relu": nn.ReLU, "tanh": nn.Tanh, "identity": nn.Identity}
        layers: list[nn.Module] = []
        for inputs, outputs in zip(self.sizes, self.sizes[1:], strict=False):
            layers += [nn.Linear(inputs, outputs), modules[self._names[len(layers) // 2]]()]
        network = nn.Sequential(*layers)
        flat = torch.from_numpy(self.parameters(genotype).copy())
        nn.utils.vector_to_parameters(flat, network.parameters())
        return network


class ModuleController:
    """Any torch module as a controller: slower than :class:`MLP`, since Python runs every step.

    Parameters
    ----------
    module : torch.nn.Module
        From (1, inputs) float32 observations to (1, outputs) actions, deterministic.
    inputs, outputs : int
        Length of an observation and of an action.

    Notes
    -----
    A genotype holds all of ``module.parameters()``, biases included, in their order.
    """

    def __init__(self, module: nn.Module, inputs: int, outputs: int) -> None:
        self._module = module
        self.inputs = inputs
        self.outputs = outputs
        self.genotype_length = sum(parameter.numel() for parameter in module.parameters())

    @property
    def layers(self) -> tuple[int, ...]:
        """Parameters of each submodule that has some of its own, in the order of the genotype."""
        met: set[int] = set()
        sizes = []
        for part in self._module.modules():
            # A parameter that two submodules share is one gene, of the first.
            own = [p for p in part.parameters(recurse=False) if id(p) not in met]
            met.update(map(id, own))
            sizes.append(sum(p.numel() for p in own))
        return tuple(size for size in sizes if size)

    def sample(self, n: int, seed: int | np.random.Generator) -> Float32s:
        """Genotypes with Xavier normal weights, and parameters of one dimension 0.

        Parameters
        ----------
        n : int
        seed : int or numpy.random.Generator

        Returns
        -------
        (n, genotype_length) float32 array
        """
        import torch

        n = check_sample(n, self.genotype_length)
        generator = torch.Generator().manual_seed(int(rng_of(seed).integers(2**63)))
        genotypes = np.zeros((n, self.genotype_length), np.float32)
        for row in genotypes:
            start = 0
            for parameter in self._module.parameters():
                if parameter.dim() > 1:
                    weight = torch.empty_like(parameter.detach())
                    torch.nn.init.xavier_normal_(weight, generator=generator)
                    row[start : start + weight.numel()] = weight.numpy().ravel()
                start += parameter.numel()
        return genotypes

    def module(self, genotype: ArrayLike) -> nn.Module:
        """A copy of the module with the genotype's parameters.

        Raises
        ------
        NichechainError
            If the genotype has the wrong length.
        """
        import torch

        flat = np.array(genotype, np.float32)
        if flat.shape != (self.genotype_length,):
            raise NichechainError(
                f"genotype has shape {flat.shape}, but this controller's has ({self.genotype_length},)"
            )
        made = copy.deepcopy(self._module)
        torch.nn.utils.vector_to_parameters(torch.from_numpy(flat), made.parameters())
        return made

    def policy(self, genotype: ArrayLike) -> Policy:
        """From observations (N, inputs) to actions (N, outputs), one row at a time."""
        import torch

        module = self.module(genotype)

        def act(observations: ArrayLike) -> Float32s:
            rows = torch.from_numpy(np.array(observations, np.float32))
            with torch.no_grad():
                # A batched product may round otherwise than the product of one row.
                actions = torch.cat([module(row[None]) for row in rows])
            return actions.numpy().astype(np.float32)

        return act
