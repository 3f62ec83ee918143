"""An emitter of QDax that notes whose offspring it emits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
from jax.experimental import io_callback
from qdax.core.containers.mapelites_repertoire import MapElitesRepertoire, get_cells_indices
from qdax.core.emitters.emitter import Emitter
from qdax.core.emitters.standard_emitters import MixingEmitter

from nichechain.births.table import NONE
from nichechain.core.checks import check_at_least
from nichechain.core.errors import NichechainError
from nichechain.qdax.blocks import DeviceBlock, DeviceRun

_OURS = "nichechain"
"""What is ours among extra scores and infos."""

_BIRTHS_OF_A_BLOCK = 8192


@partial(
    jax.tree_util.register_dataclass,
    data_fields=["inner", "run", "births", "steps", "uid", "block"],
    meta_fields=[],
)
@dataclass(frozen=True)
class RecordingState:
    """State of a :class:`RecordingEmitter`, which travels through ``jit`` and ``scan``.

    Parameters
    ----------
    inner : pytree
        State of the emitter that is wrapped.
    run, births, steps : int32 arrays
        Number of the run; births so far; steps so far, without the initial one.
    uid : (C,) int32 array
        Birth of the elite of each cell, ``NONE`` for none.
    block : tuple of arrays
        Births of the steps that have not been handed on, as in :class:`nichechain.qdax.blocks.DeviceBlock`.
    """

    inner: Any
    run: Any
    births: Any
    steps: Any
    uid: Any
    block: Any


class RecordingEmitter(Emitter):  # type: ignore[misc, unused-ignore]
    """Emits what another emitter emits, and records the births.

    The search is the one that it would be without. Parents' birth numbers travel through the
    ``extra_info`` of QDax, elites' through the emitter's state, and births leave the device in blocks.

    Parameters
    ----------
    emitter : qdax.core.emitters.emitter.Emitter
        A MixingEmitter, or one that selects one elite for each offspring, in one go.
    block : int, optional
        Steps after which births leave the device; by default so many that they are some 8,000.

    Raises
    ------
    NichechainError
        If the emitter is none. As soon as it emits, or its repertoire is made: if it selects otherwise,
        or the repertoire is not a MapElitesRepertoire.

    Notes
    -----
    The parent of what two elites were crossed for is the first, from which the line of the
    isoline variation starts. Every call of ``MAPElites.init`` begins a run.
    """

    def __init__(self, emitter: Any, *, block: int | None = None) -> None:
        if not isinstance(emitter, Emitter) or isinstance(emitter, RecordingEmitter):
            raise NichechainError(
                f"emitter is a {type(emitter).__name__}, but must be an emitter of QDax that is not recorded"
            )
        if block is not None:
            check_at_least(1, block=block)
        self.emitter = emitter
        self.runs: list[DeviceRun] = []
        self._block = block or max(1, _BIRTHS_OF_A_BLOCK // emitter.batch_size)

    @property
    def batch_size(self) -> int:
        """Offspring of a step."""
        return int(self.emitter.batch_size)

    @property
    def use_all_data(self) -> bool:
        """Whether it is told of offspring of others, see QDax."""
        return bool(self.emitter.use_all_data)

    def init(
        self,
        key: Any,
        repertoire: Any,
        genotypes: Any,
        fitnesses: Any,
        descriptors: Any,
        extra_scores: Any,
    ) -> RecordingState:
        """State before the first step; the initial births are recorded."""
        if type(repertoire).add is not MapElitesRepertoire.add:
            raise NichechainError(
                f"the repertoire is a {type(repertoire).__name__}, but only a MapElitesRepertoire is recorded"
            )
        inner = self.emitter.init(
            key=key,
            repertoire=repertoire,
            genotypes=genotypes,
            fitnesses=fitnesses,
            descriptors=descriptors,
            extra_scores=extra_scores,
        )
        size, cells = len(descriptors), len(repertoire.centroids)
        before = jnp.full((cells, 1), -jnp.inf, repertoire.fitnesses.dtype)
        nobody = jnp.full(size, NONE, jnp.int32)
        rows, uid = _births(
            repertoire.centroids, before, nobody, fitnesses, descriptors, jnp.full(cells, NONE, jnp.int32), 0
        )
        first = jax.tree.map(lambda each: each[None], rows)
        run = io_callback(self._begin, jax.ShapeDtypeStruct((), jnp.int32), *first)
        shape = (self._block, self.batch_size)
        block = jax.tree.map(lambda each: jnp.zeros((*shape, *each.shape[1:]), each.dtype), rows)
        return RecordingState(inner, run, jnp.int32(size), jnp.int32(0), uid, block)

    def emit(self, repertoire: Any, emitter_state: RecordingState, key: Any) -> tuple[Any, Any]:
        """Offspring, and beside what the emitter tells of them their parents."""
        watched = _Watched(repertoire, emitter_state.uid)
        genotypes, info = self.emitter.emit(watched, emitter_state.inner, key)
        size = jax.tree.leaves(genotypes)[0].shape[0]
        parent = parents_of(self.emitter, watched.selected, size)
        return genotypes, {**info, _OURS: {"parent": parent, "fitnesses": repertoire.fitnesses}}

    def state_update(
        self,
        emitter_state: RecordingState,
        repertoire: Any = None,
        genotypes: Any = None,
        fitnesses: Any = None,
        descriptors: Any = None,
        extra_scores: Any = None,
    ) -> RecordingState:
        """State after a step, whose births are recorded."""
        scores = dict(extra_scores or {})
        told = scores.pop(_OURS, None)
        if told is None:
            raise NichechainError(
                "extra_info does not have the parents of the offspring: tell() must be given what ask() gave"
            )
        inner = self.emitter.state_update(
            emitter_state=emitter_state.inner,
            repertoire=repertoire,
            genotypes=genotypes,
            fitnesses=fitnesses,
            descriptors=descriptors,
            extra_scores=scores,
        )
        state = emitter_state
        rows, uid = _births(
            repertoire.centroids,
            told["fitnesses"],
            told["parent"],
            fitnesses,
            descriptors,
            state.uid,
            state.births,
        )
        at = state.steps % self._block
        block = jax.tree.map(lambda whole, each: whole.at[at].set(each), state.block, rows)
        jax.lax.cond(
            at == self._block - 1,
            lambda run, first, each: io_callback(self._receive, None, run, first, *each),
            lambda *_: None,
            state.run,
            state.steps - at,
            block,
        )
        return RecordingState(inner, state.run, state.births + len(descriptors), state.steps + 1, uid, block)

    # What the device calls.

    def _begin(self, *initial: Any) -> Any:
        self.runs.append(DeviceRun(DeviceBlock.copied(initial)))
        return jnp.int32(len(self.runs) - 1)

    def _receive(self, run: Any, first: Any, *block: Any) -> None:
        self.runs[int(run)].blocks[int(first)] = DeviceBlock.copied(block)


def parents_of(emitter: Any, selected: list[Any], size: int) -> Any:
    """Births that offspring come from, (size,).

    Parameters
    ----------
    emitter : qdax.core.emitters.emitter.Emitter
    selected : list of (n,) arrays
        Births of the elites that it has selected, call by call.
    size : int

    Raises
    ------
    NichechainError
        If it is not known which of them became whose parent.
    """
    if isinstance(emitter, MixingEmitter):
        # Crossed are those of the first call with those of the second; the last call is for mutation.
        first = selected[:1] + (selected[2:] if len(selected) == 3 else [])
        return jnp.concatenate(first)
    sizes = [each.shape[0] for each in selected]
    if sizes != [size]:
        said = " and ".join(map(str, sizes)) or "no"
        raise NichechainError(
            f"the emitter is a {type(emitter).__name__}, which selects {said} elites for {size} offspring, "
            "so that their parents are not known: it must be a MixingEmitter, or select one for each at once"
        )
    return selected[0]


class _Watched:
    """A repertoire that notes which births are selected."""

    def __init__(self, repertoire: Any, uid: Any) -> None:
        self._plain = repertoire
        self._with_births = repertoire.replace(extra_scores={**repertoire.extra_scores, _OURS: uid})
        self.selected: list[Any] = []

    def select(self, *args: Any, **kwargs: Any) -> Any:
        """What the repertoire selects."""
        chosen = self._with_births.select(*args, **kwargs)
        self.selected.append(chosen.extra_scores[_OURS])
        return chosen

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plain, name)


def _births(
    centroids: Any, before: Any, parent: Any, fitnesses: Any, descriptors: Any, uid: Any, first: Any
) -> tuple[Any, Any]:
    """Births of one step as a block has them, and the births of the elites (C,) after it.

    Who enters is worked out as the repertoire does, which a compiler does once for both.
    """
    size, cells = len(descriptors), len(centroids)
    cell = get_cells_indices(descriptors, centroids)
    fitness = jnp.reshape(fitnesses, size)
    best = jax.ops.segment_max(fitness, cell.astype(jnp.int32), num_segments=cells)
    better = fitness > before[cell, 0]
    entered = better & (fitness == best[cell])
    numbers = first + jnp.arange(size, dtype=jnp.int32)
    uid = uid.at[jnp.where(entered, cell, cells)].set(numbers)
    return (parent.astype(jnp.int32), cell.astype(jnp.int32), better, fitness, descriptors), uid
