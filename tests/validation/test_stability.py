"""Whether thinned births rank alike: where they must, and where there is nothing to rank."""

from dataclasses import replace

import numpy as np
import pytest

from nichechain import GridNiches, NichechainError, TransitionCounts
from nichechain.validation.stability import RankStability, _Thinner, rank_stability

GRID = GridNiches((4, 4), ((0.0, 1.0), (0.0, 1.0)), "clip")


def births(T, per_row, seed, elites=10):
    rng = np.random.default_rng(seed)
    parent = np.repeat(np.arange(len(T)), per_row)
    child = np.array([rng.choice(len(T), p=T[i]) for i in parent])
    return TransitionCounts.from_births(
        parent, child, GRID, elite=parent * elites + np.arange(parent.size) % elites
    )


def spreading():
    """Niche i has i + 1 niches to go to, from which nobody moves: their ranking is their number."""
    T = np.zeros((16, 16))
    for i in range(16):
        T[i, : i + 1] = 1 / (i + 1)
    return T


@pytest.mark.parametrize("thin", ["elite", "birth"])
def test_clear_differences_need_few_births(thin):
    found = rank_stability(births(spreading(), 400, 0), thin=thin, l=1, lineages=20, repeats=2, draws=10)
    assert found.niches == 16
    assert found.spearman[-1].min() > 0.95
    assert found.halves.min() > 0.9
    assert found.enough is not None
    assert f"{found.enough:.0%} of the births" in found.answer
    assert "not enough" not in found.answer
    np.testing.assert_allclose(found.births / found.all_births, found.fractions, atol=0.08)
    # Niche i has i + 1 ways on, each as likely: (i + 1)(1 − (1 − 1/(i + 1))^20) are seen by 20 children.
    ways = np.arange(1, 17)
    expected = (ways * (1 - (1 - 1 / ways) ** 20)).mean()
    assert found.all_level == pytest.approx(expected, rel=0.05)
    assert found.level[-1].mean() == pytest.approx(expected, rel=0.05)


def test_niches_that_do_not_differ_are_never_ranked_alike():
    T = np.full((16, 16), 1 / 16)
    found = rank_stability(births(T, 100, 1), l=1, lineages=20, repeats=3, draws=5)
    assert abs(found.halves.mean()) < 0.5
    assert "Too few births" in found.answer or "births are not enough" in found.answer


@pytest.mark.parametrize("thin", ["elite", "birth"])
@pytest.mark.parametrize("known", [True, False])
def test_parts_are_nested_and_make_up_the_whole(thin, known):
    counts = births(spreading(), 30, 2)
    if not known:
        counts = replace(counts, families=np.empty((0, 4), np.int64))
    rank = _Thinner(counts, thin, np.random.default_rng(0))
    whole = rank.part(0.0, 1.0)
    np.testing.assert_array_equal(whole.matrix.toarray(), counts.matrix.toarray())
    assert sorted(map(tuple, whole.families)) == sorted(map(tuple, counts.families))
    first, second, less = rank.part(0.0, 0.5), rank.part(0.5, 1.0), rank.part(0.0, 0.2)
    np.testing.assert_array_equal((first.matrix + second.matrix).toarray(), counts.matrix.toarray())
    assert (less.matrix.toarray() <= first.matrix.toarray()).all()
    if known and thin == "elite":
        # An elite is kept with all its children or not at all.
        assert not set(first.families[:, 1]) & set(second.families[:, 1])


def made(spearman, halves):
    fractions = np.array([0.25, 0.5, 0.75])
    return RankStability(
        fractions,
        1000 * fractions,
        np.array(spearman)[:, None],
        np.full((3, 1), 7.0),
        7.0,
        np.array([halves]),
        50,
        1000,
        "elite",
        20,
        5,
        100,
        "mle",
    )


@pytest.mark.parametrize(
    ("spearman", "halves", "enough", "said"),
    [
        ([0.95, 0.96, 0.98], 0.92, 0.25, "25% of the births (250) rank the niches nearly as all 1000 do"),
        # A lucky small part does not count where a larger one falls below again.
        ([0.92, 0.85, 0.95], 0.9, 0.75, "75% of the births (750)"),
        ([0.5, 0.6, 0.7], 0.4, None, "even 75% of them rank the niches only to a correlation of 0.70"),
        # Spearman-Brown: 2 · 0.6 / 1.6 = 0.75.
        ([0.95, 0.96, 0.98], 0.6, 0.25, "not enough: two halves that share no birth agree to 0.60"),
        ([0.95, 0.96, 0.98], 0.6, 0.25, "agree to about 0.75"),
    ],
)
def test_answer(spearman, halves, enough, said):
    found = made(spearman, halves)
    assert found.enough == enough
    assert said in found.answer


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"fractions": (0.5, 1.0)}, "must be between 0 and 1"),
        ({"fractions": ()}, "must be between 0 and 1"),
        ({"thin": "niche"}, "thin is 'niche'"),
        ({"repeats": 0}, "repeats is 0"),
        ({"min_births": 41}, "0 niches have 41 births"),
        ({"draws": 0}, "draws is 0"),
        ({"l": 0}, "l is 0"),
    ],
)
def test_bad_arguments(options, said):
    with pytest.raises(NichechainError, match=said):
        rank_stability(births(spreading(), 40, 3), **options)
