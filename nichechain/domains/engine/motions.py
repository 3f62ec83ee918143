"""The cache of motions: a tree of what was simulated, so that no motion is simulated twice.

An episode always begins in one state, and nothing in it is random. So what has happened after some
actions is a function of those actions. The tree's nodes are such states, and its edges are actions:
an episode walks down by policy alone, and computes physics only from where nobody has been.

Policies with large weights saturate: their actions are exactly -1 or 1 in every component, and so
come again. Other actions practically never do. Only edges whose components are all -1, 0 or 1 are
kept, so that a policy which does not saturate costs and occupies nothing.

A node holds what the next step reads, and what the policy sees. Threads walk without a lock: a node
is complete before it is linked. Insertion and eviction take turns, and eviction waits for those who
walk, which takes microseconds, for nobody computes physics then.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
from numba import carray  # type: ignore[attr-defined]
from numpy.typing import NDArray

from nichechain.core.compiled import compiled
from nichechain.domains.engine._memory import floats_at, load, store
from nichechain.domains.engine.policy import forward

_log = logging.getLogger(__name__)

# The words of a node, before what it holds.
_PARENT, _CODE, _CHILD, _SIBLING, _USED, _CONTENT = range(6)
_WORD = 8
_SLAB_ROWS = 4096
# More than any machine has, so that the list of slabs stays short.
_MOST = 2**40


@compiled
def code_of(action: Any, blocked: Any) -> Any:
    """A number for a clipped action whose components are all -1, 0 or 1; -1 for any other.

    Parameters
    ----------
    action : (4,) float32
        Before it is clipped.
    blocked : bool
        Whether the fingers are held shut, so that the last component has no effect.
    """
    code = 0
    for k in range(action.size - 1 if blocked else action.size):
        value = action[k]
        if value >= np.float32(1.0):
            digit = 2
        elif value <= np.float32(-1.0):
            digit = 0
        elif value == np.float32(0.0) and not np.signbit(value):
            digit = 1
        else:
            return -1
        code = 3 * code + digit
    return code


@compiled
def _address(slabs: Any, rows: Any, width: Any, node: Any) -> Any:
    return slabs[node // rows] + (node % rows) * width * _WORD


@compiled
def _child(slabs: Any, rows: Any, width: Any, node: Any, code: Any) -> Any:
    """The node that an action leads to; -1 if nobody has been there."""
    child = load(_address(slabs, rows, width, node) + _CHILD * _WORD)
    while child >= 0:
        address = _address(slabs, rows, width, child)
        if load(address + _CODE * _WORD) == code:
            return child
        child = load(address + _SIBLING * _WORD)
    return np.int64(-1)


@compiled
def walk(
    slabs: Any,
    rows: Any,
    width: Any,
    now: Any,
    blocked: Any,
    parameters: Any,
    sizes: Any,
    activations: Any,
    observations: Any,
    actions: Any,
    codes: Any,
    snapshot: Any,
) -> Any:
    """Go down the tree as far as it is known where the policy leads; how many steps that is.

    Parameters
    ----------
    slabs : (S,) int64
        Addresses of the slabs that hold the nodes.
    rows, width : int
        Nodes of a slab, words of a node.
    now : int
        When this is, for the nodes on the way.
    blocked : bool
        As in :func:`code_of`.
    parameters, sizes, activations
        The policy, see :func:`nichechain.domains.engine.policy.forward`.
    observations, actions, codes : (steps + 1, inputs), (steps, 4), (steps,)
        Written as far as they are known.
    snapshot : (state,) float64
        Written: what the next step reads.
    """
    hidden = np.empty((2, sizes.max()), np.float32)
    inputs = observations.shape[1]
    node = np.int64(0)
    t = 0
    while True:
        address = _address(slabs, rows, width, node)
        if load(address + _USED * _WORD) < now:
            store(address + _USED * _WORD, now)
        content = carray(floats_at(address + _CONTENT * _WORD), (width - _CONTENT,))
        observations[t] = content[:inputs]
        if t == actions.shape[0]:
            return t
        forward(parameters, sizes, activations, hidden, observations[t], actions[t])
        codes[t] = code_of(actions[t], blocked)
        child = np.int64(-1) if codes[t] < 0 else _child(slabs, rows, width, node, codes[t])
        if child < 0:
            snapshot[:] = content[inputs:]
            return t
        node = child
        t += 1


@compiled
def _write(
    slabs: Any, rows: Any, width: Any, node: Any, parent: Any, code: Any, now: Any, seen: Any, state: Any
) -> None:
    """Complete a node, then link it to its parent, which makes it visible to those who walk."""
    link = _address(slabs, rows, width, parent) + _CHILD * _WORD
    address = _address(slabs, rows, width, node)
    store(address + _PARENT * _WORD, parent)
    store(address + _CODE * _WORD, code)
    store(address + _CHILD * _WORD, np.int64(-1))
    store(address + _SIBLING * _WORD, load(link) if node else np.int64(-1))
    store(address + _USED * _WORD, now)
    content = carray(floats_at(address + _CONTENT * _WORD), (width - _CONTENT,))
    content[: seen.size] = seen
    content[seen.size :] = state
    if node:
        store(link, node)


@compiled
def _insert(
    slabs: Any,
    rows: Any,
    width: Any,
    used: Any,
    capacity: Any,
    now: Any,
    first: Any,
    codes: Any,
    observations: Any,
    states: Any,
) -> Any:
    """Add the steps from ``first`` on, up to an action without a code; how many nodes there are then.

    Nothing is added if the way to ``first`` is no longer in the tree.
    """
    node = np.int64(0)
    for t in range(codes.size):
        if codes[t] < 0:
            break
        child = _child(slabs, rows, width, node, codes[t])
        if child < 0:
            if t < first or used == capacity:
                break
            child = used
            _write(slabs, rows, width, child, node, codes[t], now, observations[t + 1], states[t])
            used += 1
        node = child
    return used


@compiled
def _stamps(slabs: Any, rows: Any, width: Any, used: Any) -> Any:
    """When each node was last used."""
    stamps = np.empty(used, np.int64)
    for node in range(used):
        stamps[node] = load(_address(slabs, rows, width, node) + _USED * _WORD)
    return stamps


@compiled
def _compact(slabs: Any, rows: Any, width: Any, places: Any, capacity: Any, newest_lost: Any) -> Any:
    """Drop nodes last used at ``newest_lost`` or before, and what would not fit; how many are left.

    A parent comes before its children, in memory and in last use, so whole branches go.

    Parameters
    ----------
    places : (used,) int64
        When each node was last used; overwritten.
    """
    left = np.int64(1)
    places[0] = 0
    for node in range(1, places.size):
        source = _address(slabs, rows, width, node)
        parent = places[load(source + _PARENT * _WORD)]
        if places[node] <= newest_lost or parent < 0 or left == capacity:
            places[node] = -1
            continue
        target = carray(floats_at(_address(slabs, rows, width, left)), (width,))
        target[:] = carray(floats_at(source), (width,))
        store(_address(slabs, rows, width, left) + _PARENT * _WORD, parent)
        places[node] = left
        left += 1
    for node in range(left):
        address = _address(slabs, rows, width, node)
        store(address + _CHILD * _WORD, np.int64(-1))
        if node:
            link = _address(slabs, rows, width, load(address + _PARENT * _WORD)) + _CHILD * _WORD
            store(address + _SIBLING * _WORD, load(link))
            store(link, np.int64(node))
    return left


class Motions:
    """The tree of one start state; safe to use from several threads.

    Parameters
    ----------
    limit : int
        Bytes that it may occupy, which it takes as it grows.
    observation : (inputs,) float64 array
        What is seen at the start.
    state : int
        Numbers of a snapshot.
    blocked : bool
        As in :func:`code_of`.

    Raises
    ------
    MemoryError
        If there is no memory even for a small tree.
    """

    def __init__(self, limit: int, observation: NDArray[np.float64], state: int, *, blocked: bool) -> None:
        self._width = _CONTENT + observation.size + state
        self.state = state
        self._blocked = blocked
        self._capacity = max(1, min(limit, _MOST) // (self._width * _WORD))
        self._rows = min(_SLAB_ROWS, self._capacity)
        self._slabs: list[NDArray[np.float64]] = []
        # Slabs are added while others walk, so the list of addresses never moves.
        self._addresses = np.zeros(-(-self._capacity // self._rows), np.int64)
        self._turn = threading.Condition()
        self._walking = 0
        self._clock = 0
        self._used = 0
        self._add_slab()
        _write(*self._tree, 0, 0, 0, 0, observation, np.zeros(state))
        self._used = 1

    @property
    def _tree(self) -> tuple[NDArray[np.int64], int, int]:
        return self._addresses, self._rows, self._width

    def __len__(self) -> int:
        """States in the tree, the first among them."""
        return self._used

    @property
    def memory(self) -> int:
        """Bytes that it occupies."""
        return sum(slab.nbytes for slab in self._slabs)

    def walk(self, policy: tuple[Any, Any, Any], seen: Any, done: Any, codes: Any, snapshot: Any) -> int:
        """Steps of an episode that are known already, see :func:`walk`."""
        with self._walker() as now:
            known: int = walk(*self._tree, now, self._blocked, *policy, seen, done, codes, snapshot)
        return known

    def insert(self, known: int, seen: Any, codes: Any, states: Any) -> None:
        """Keep what an episode has simulated from step ``known`` on, as far as it may come again.

        Parameters
        ----------
        known : int
            What :meth:`walk` returned.
        seen : (steps + 1, inputs) float64 array
        codes : (steps,) int64 array
            Of all actions, -1 from the first on that has none.
        states : (steps, state) float64 array
            Snapshots after every action from ``known`` on that has a code.
        """
        if known == len(codes) or codes[known] < 0:
            return
        with self._turn:
            self._make_room(len(codes) - known)
            self._used = _insert(
                *self._tree, self._used, self._capacity, self._clock, known, codes, seen, states
            )

    @contextmanager
    def _walker(self) -> Iterator[int]:
        with self._turn:
            self._walking += 1
            self._clock += 1
            now = self._clock
        try:
            yield now
        finally:
            with self._turn:
                self._walking -= 1
                if not self._walking:
                    self._turn.notify_all()

    def _make_room(self, nodes: int) -> None:
        """Have memory for some more nodes, or for as many of them as the limit allows."""
        while self._used + nodes > min(self._capacity, len(self._slabs) * self._rows):
            if len(self._slabs) < len(self._addresses) and len(self._slabs) * self._rows < self._capacity:
                try:
                    self._add_slab()
                except MemoryError:
                    self._shrink()
            elif self._walking:
                # Meanwhile another thread may make room.
                self._turn.wait()
            else:
                self._evict(self._capacity)
                return

    def _add_slab(self) -> None:
        rows = min(self._rows, self._capacity - len(self._slabs) * self._rows)
        slab = np.empty((rows, self._width))
        self._addresses[len(self._slabs)] = slab.ctypes.data
        self._slabs.append(slab)

    def _evict(self, capacity: int) -> None:
        """Drop the half of the nodes that was used least recently; nobody may be walking."""
        try:
            stamps = _stamps(*self._tree, self._used)
            newest_lost = np.partition(stamps, self._used // 2)[self._used // 2]
        except MemoryError:
            stamps, newest_lost = np.zeros(1, np.int64), 0
        self._used = _compact(*self._tree, stamps, capacity, newest_lost)

    def _shrink(self) -> None:
        """Give half of the memory back, for others need some too, and take no more from now on."""
        while self._walking:
            self._turn.wait()
        keep = max(1, len(self._slabs) // 2)
        self._capacity = keep * self._rows
        if self._used > self._capacity // 2:
            self._evict(self._capacity)
        del self._slabs[keep:]
        _log.warning("memory ran out: the cache of motions goes on with %.0f MB", self.memory / 1e6)
