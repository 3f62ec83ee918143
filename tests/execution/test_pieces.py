"""Every row of a batch is evaluated, whoever is lost, and nothing is cut finer than it must be."""

from __future__ import annotations

import math

from hypothesis import given, settings
from hypothesis import strategies as st

from nichechain.domains import PlanarArm
from nichechain.execution.pieces import LOSSES, Piece, Pieces

from .samples import assert_same, numbered


@settings(deadline=None)
@given(rows=st.integers(1, 400), chunk=st.integers(1, 50), workers=st.integers(1, 9), data=st.data())
def test_every_row_once_in_any_order_and_with_any_losses(
    rows: int, chunk: int, workers: int, data: st.DataObject
) -> None:
    genotypes, arm = numbered(rows), PlanarArm()
    pieces = Pieces(rows, chunk, workers)
    out: list[Piece] = []
    done = 0
    while pieces.left:
        piece = pieces.take()
        if piece is not None:
            out.append(piece)
            if data.draw(st.booleans()):
                continue
        piece = out.pop(data.draw(st.integers(0, len(out) - 1)))
        fate = data.draw(st.sampled_from(["done", "returned", "lost"]))
        if fate == "returned":
            pieces.put_back(piece)
        elif fate != "lost" or not pieces.lose(piece):
            pieces.finish(piece, arm.evaluate(genotypes[piece.start : piece.stop]))
            done += len(piece)
        assert pieces.left == rows - done
    assert done == rows
    assert pieces.take() is None
    assert_same(pieces.evaluation(), arm.evaluate(genotypes))


def cut(rows: int, chunk: int, workers: int) -> list[int]:
    pieces = Pieces(rows, chunk, workers)
    return [len(piece) for piece in iter(pieces.take, None)]


def test_pieces_shrink() -> None:
    # A quarter of each worker's share of what is left, at most 16 chunks.
    assert cut(256, 1, 2)[:9] == [16] * 9
    assert cut(100, 1, 2)[:4] == [13, 11, 10, 9]
    assert cut(100, 1, 2)[-8:] == [1] * 8
    assert cut(64, 4096, 2) == [64]
    assert cut(33, 5, 1) == [10, 10, 5, 5, 3]


@given(st.integers(1, 2000), st.integers(1, 64), st.integers(1, 64))
def test_pieces_are_whole_chunks_and_few(rows: int, chunk: int, workers: int) -> None:
    sizes = cut(rows, chunk, workers)
    assert sum(sizes) == rows
    assert all(size % chunk == 0 for size in sizes[:-1])
    assert sizes == sorted(sizes, reverse=True)
    # Each piece is at least 1 / (4 workers) of the rest, or 16 chunks, or the least there is.
    chunks = math.ceil(rows / chunk)
    each = 4 * workers
    assert len(sizes) <= chunks / 16 + each * (1 + math.log(max(1, chunks / each))) + 1


def test_lost_rows_come_back_in_chunks_then_alone_and_at_last_not_at_all() -> None:
    pieces = Pieces(64, 4, 1)
    first = pieces.take()
    assert first == Piece(0, 16)
    assert pieces.lose(first)
    again = [pieces.take() for _ in range(4)]
    assert again == [Piece(start, start + 4, losses=1) for start in (0, 4, 8, 12)]
    assert pieces.lose(again[1])
    alone = [pieces.take() for _ in range(4)]
    assert alone == [Piece(start, start + 1, losses=2) for start in (4, 5, 6, 7)]
    assert LOSSES == 3
    assert not pieces.lose(alone[2])


def test_a_row_that_is_a_chunk_gets_as_many_tries() -> None:
    pieces = Pieces(1, 1, 1)
    for losses in range(LOSSES - 1):
        piece = pieces.take()
        assert piece == Piece(0, 1, losses)
        assert pieces.lose(piece)
    last = pieces.take()
    assert last is not None
    assert not pieces.lose(last)
    assert pieces.take() is None


def test_a_suspect_is_for_an_idle_worker() -> None:
    pieces = Pieces(10, 1, 1)
    first = pieces.take()
    assert first is not None
    assert pieces.lose(first)
    assert pieces.take(idle=False) is None
    suspect = pieces.take()
    assert suspect is not None
    assert (suspect.start, suspect.losses) == (first.start, 1)
