"""Broods on their way: what a worker grows is what was described, and it is told everything once."""

from __future__ import annotations

import pickle
from dataclasses import replace

import cloudpickle
import numpy as np
import pytest

from nichechain import variation
from nichechain.core.randomness import Purpose
from nichechain.execution import growing
from nichechain.execution.growing import Receiver, Sender, by_parent
from nichechain.variation.unborn import Unborn

LENGTH = 50


def unborn(seed: int, named: bool, mutate: variation.Mutation | None = None) -> Unborn:
    """Children of 5 of 8 parents, who are the same whatever the seed."""
    rng = np.random.default_rng(seed)
    everyone = np.random.default_rng(0).normal(size=(8, LENGTH)).astype(np.float32)
    some = rng.choice(8, 5, replace=False)
    return Unborn(
        mutate or variation.cauchy(),
        Purpose.MUTATION,
        everyone[some],
        tuple(range(5)),
        rng.integers(5, size=20),
        rng.integers(2**40, size=20),
        [("search", int(one)) for one in some] if named else None,
    )


def delivered(sender: Sender, receiver: Receiver, sent: Unborn) -> tuple[Unborn, growing.Letter]:
    letter = pickle.loads(pickle.dumps(sender.letter(sent, cloudpickle.dumps(sent.mutate))))
    return receiver.unborn(letter), letter


@pytest.mark.parametrize("named", [True, False])
def test_a_worker_grows_what_was_described(named: bool) -> None:
    sender, receiver = Sender(), Receiver()
    for number in range(6):
        sent = replace(unborn(number, named), seeds=(7, 7, 7, 7, 7))
        if number == 3:
            sent = replace(sent, mutate=variation.gaussian(0.1))
        found, _ = delivered(sender, receiver, sent)
        np.testing.assert_array_equal(found.grow(), sent.grow())


def test_parents_and_operator_travel_once() -> None:
    sender, receiver = Sender(), Receiver()
    told: set[object] = set()
    for number in range(6):
        sent = unborn(number, named=True)
        assert sent.names is not None
        wanted = {sent.names[row] for row in np.unique(sent.parent)}
        _, letter = delivered(sender, receiver, sent)
        assert len(letter.parents) == len(wanted - told)
        assert (letter.mutate is None) == (number > 0)
        assert not letter.forget
        told |= wanted
    _, letter = delivered(sender, receiver, sent)
    # A child is then two numbers.
    assert len(pickle.dumps(letter)) < 1000
    assert letter.parent.nbytes + letter.number.nbytes == 16 * len(sent)


def test_a_worker_does_not_keep_parents_forever(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growing, "MEMORY", 8 * 4 * LENGTH)
    sender, receiver = Sender(), Receiver()
    forgotten = 0
    for number in range(20):
        sent = unborn(number, named=number % 3 == 0)
        found, letter = delivered(sender, receiver, sent)
        np.testing.assert_array_equal(found.grow(), sent.grow())
        assert len(receiver._parents) <= 8 + 5
        forgotten += letter.forget
    assert forgotten > 3


def test_siblings_go_side_by_side_and_back() -> None:
    sent = unborn(3, named=False)
    ordered, back = by_parent(sent)
    assert (np.diff(ordered.parent) >= 0).all()
    np.testing.assert_array_equal(ordered.grow()[back], sent.grow())
