"""MAP-Elites of QDax, recorded inside jit and scan."""

from __future__ import annotations

import functools

import numpy as np
import pytest

import nichechain as nc
from nichechain import NichechainError

jax = pytest.importorskip("jax")
pytest.importorskip("qdax")

import jax.numpy as jnp  # noqa: E402
from qdax.core.containers.mapelites_repertoire import (  # noqa: E402
    MapElitesRepertoire,
    compute_euclidean_centroids,
)
from qdax.core.emitters.emitter import Emitter  # noqa: E402
from qdax.core.emitters.multi_emitter import MultiEmitter  # noqa: E402
from qdax.core.emitters.mutation_operators import isoline_variation  # noqa: E402
from qdax.core.emitters.standard_emitters import MixingEmitter  # noqa: E402
from qdax.core.map_elites import MAPElites  # noqa: E402

from nichechain.qdax import RecordingEmitter, from_qdax  # noqa: E402

BOUNDS = ((-1.0, 1.0), (-2.0, 2.0))
BATCH, STEPS = 12, 11
GRID = np.asarray(compute_euclidean_centroids((6, 4), [-1.0, -2.0], [1.0, 2.0]))
CVT = np.random.default_rng(0).uniform([-1, -2], [1, 2], (15, 2)).astype(np.float32)


def score(genotypes, key):
    del key
    weights, bias = genotypes["weights"], genotypes["bias"]
    descriptor = jnp.stack([weights[:, 0, 0], 2 * weights[:, 1, 1] + bias], axis=1)
    return -jnp.square(weights).sum(axis=(1, 2)), descriptor, {}


def mutate(genotypes, key):
    """Steps so tiny that parents can be told from solutions."""
    leaves, form = jax.tree.flatten(genotypes)
    noise = [
        1e-6 * jax.random.normal(each, leaf.shape)
        for each, leaf in zip(jax.random.split(key, 2), leaves, strict=True)
    ]
    return jax.tree.unflatten(form, [leaf + step for leaf, step in zip(leaves, noise, strict=True)])


def mixing(share, variation=None, mutation=mutate):
    if variation is None:
        variation = functools.partial(isoline_variation, iso_sigma=1e-6, line_sigma=0.0)
    return MixingEmitter(mutation, variation, share, BATCH)


def run(emitter, centroids=GRID, *, how="scan", steps=STEPS, seed=0, scoring=score):
    search = MAPElites(scoring, emitter, lambda repertoire: repertoire.fitnesses)
    key, first, second = jax.random.split(jax.random.key(seed), 3)
    genotypes = {
        "weights": 0.7 * jax.random.normal(first, (20, 2, 2)),
        "bias": 0.1 * jax.random.normal(second, (20,)),
    }
    if how == "scan":
        init = jax.jit(search.init) if seed else search.init
        repertoire, state, _ = init(genotypes, centroids, key)
        scan = jax.jit(lambda carry: jax.lax.scan(search.scan_update, carry, (), length=steps))
        (repertoire, state, _), _ = scan((repertoire, state, key))
    else:
        repertoire, state, _ = search.init(genotypes, centroids, key)
        for _ in range(steps):
            key, own = jax.random.split(key)
            repertoire, state, _ = search.update(repertoire, state, own)
    return repertoire, state


def flat(genotypes):
    leaves = jax.tree.leaves(genotypes)
    return np.concatenate([np.asarray(leaf).reshape(len(leaf), -1) for leaf in leaves], axis=1)


class Told:
    """Every genotype that is scored, in order, told by the device."""

    def __init__(self):
        self.genotypes = []

    def __call__(self, genotypes, key):
        jax.debug.callback(lambda each: self.genotypes.append(flat(each)), genotypes, ordered=True)
        return score(genotypes, key)


@pytest.mark.parametrize(
    ("share", "centroids", "how"), [(0.5, GRID, "scan"), (1.0, CVT, "scan"), (0.0, GRID, "update")]
)
def test_parents_are_the_elites_that_offspring_resemble(share, centroids, how, tmp_path):
    emitter, told = RecordingEmitter(mixing(share), block=4), Told()
    repertoire, state = run(emitter, centroids, how=how, scoring=told)
    archive = from_qdax(emitter, repertoire, state, tmp_path / "archive", bounds=BOUNDS)
    births = archive.births()
    genotypes = np.concatenate(told.genotypes)
    assert len(births) == len(genotypes) == 20 + STEPS * BATCH
    assert births["step"].tolist() == [0] * 20 + np.repeat(np.arange(1, STEPS + 1), BATCH).tolist()
    children = births["parent_uid"].notna()
    assert children.tolist() == [False] * 20 + [True] * (STEPS * BATCH)
    parents = births["parent_uid"][children].astype(int)
    assert np.abs(genotypes[children] - genotypes[parents]).max() < 1e-4
    assert (births["parent_niche"][children].to_numpy() == births["child_niche"][parents].to_numpy()).all()
    assert (births["depth"][children].to_numpy() == births["depth"][parents].to_numpy() + 1).all()
    behavior = births[["behavior_axis_0", "behavior_axis_1"]].to_numpy().astype(np.float32)
    np.testing.assert_array_equal(births["child_niche"], archive.niches.of(behavior))
    assert (births["child_niche"] == len(archive.niches)).any()
    # Elites are what the repertoire holds, by the births that they are.
    inside = archive.elites[archive.elites.niche < len(archive.niches)]
    np.testing.assert_array_equal(inside.genotype, genotypes[inside.uid].astype(np.float32))
    held = {tuple(each) for each in flat(repertoire.genotypes).astype(np.float32)}
    assert {tuple(each) for each in inside.genotype} <= held
    assert births["accepted"][inside.uid].all()
    np.testing.assert_array_equal(births["objective"][inside.uid], inside.objective)


@pytest.mark.parametrize("block", [3, STEPS, None])
def test_blocks_change_nothing(block, tmp_path):
    plain, _ = run(mixing(0.5))
    emitter = RecordingEmitter(mixing(0.5), block=block)
    repertoire, state = run(emitter)
    for ours, theirs in zip(jax.tree.leaves(repertoire), jax.tree.leaves(plain), strict=True):
        np.testing.assert_array_equal(ours, theirs)
    one = RecordingEmitter(mixing(0.5), block=2)
    births = [
        from_qdax(each, *run(each), tmp_path / str(number), bounds=BOUNDS).births()
        for number, each in enumerate((one, emitter))
    ]
    assert births[0].equals(births[1])
    del state


def test_niches_are_the_cells(tmp_path):
    emitter = RecordingEmitter(mixing(1.0))
    repertoire, state = run(emitter)
    clipped = from_qdax(emitter, repertoire, state, tmp_path / "a", bounds=BOUNDS, outside="clip")
    assert clipped.niches == nc.GridNiches((6, 4), BOUNDS, "clip")
    assert clipped.filled == np.isfinite(np.asarray(repertoire.fitnesses)).sum()
    emitter = RecordingEmitter(mixing(1.0))
    archive = from_qdax(emitter, *run(emitter, CVT), tmp_path / "b", bounds=BOUNDS)
    assert archive.niches == nc.CVTNiches(CVT.astype(np.float64), BOUNDS)
    assert archive.meta.origin["program"].startswith("QDax 0.5")
    again = from_qdax(emitter, *run(emitter, CVT), tmp_path / "b", bounds=BOUNDS, overwrite=True)
    assert again.births().equals(archive.births())
    assert nc.l_evolvability(again.chain(), niche=int(again.elites.niche[0]), l=2, lineages=5).value >= 1


def test_every_init_begins_a_run(tmp_path):
    emitter = RecordingEmitter(mixing(1.0), block=2)
    found = [run(emitter, seed=seed) for seed in (0, 1)]
    births = [
        from_qdax(emitter, *each, tmp_path / str(number), bounds=BOUNDS).births()
        for number, each in enumerate(found)
    ]
    assert len(emitter.runs) == 2
    assert not births[0].equals(births[1])
    lone = RecordingEmitter(mixing(1.0), block=2)
    assert from_qdax(lone, *run(lone), tmp_path / "lone", bounds=BOUNDS).births().equals(births[0])


def test_what_is_not_finite_is_a_failed_birth(tmp_path):
    def sometimes(genotypes, key):
        fitness, descriptor, extra = score(genotypes, key)
        return fitness.at[0].set(-jnp.inf), descriptor, extra

    emitter = RecordingEmitter(mixing(1.0))
    archive = from_qdax(emitter, *run(emitter, scoring=sometimes), tmp_path / "a", bounds=BOUNDS)
    births = archive.births()
    failed = births["failed"].notna()
    assert failed.sum() == STEPS + 1
    assert births["child_niche"][failed].isna().all()
    assert not births["accepted"][failed].any()


class Twice(Emitter):
    batch_size = BATCH

    def emit(self, repertoire, emitter_state, key):
        del emitter_state
        repertoire.select(key, 3)
        return repertoire.select(key, BATCH).genotypes, {}


class Once(Twice):
    def emit(self, repertoire, emitter_state, key):
        del emitter_state
        return mutate(repertoire.select(key, BATCH).genotypes, key), {}


def test_an_emitter_of_ones_own_selects_one_elite_for_each_offspring(tmp_path):
    emitter = RecordingEmitter(Once())
    archive = from_qdax(emitter, *run(emitter), tmp_path / "a", bounds=BOUNDS)
    assert archive.births()["parent_uid"].notna().sum() == STEPS * BATCH


@pytest.mark.parametrize(
    ("emitter", "message"),
    [
        (Twice, "the emitter is a Twice, which selects 3 and 12 elites for 12 offspring"),
        (lambda: MultiEmitter((mixing(1.0), mixing(1.0))), "the emitter is a MultiEmitter"),
    ],
)
def test_emitters_whose_parents_are_not_known_are_refused(emitter, message):
    with pytest.raises(NichechainError, match=message):
        run(RecordingEmitter(emitter()), how="update", steps=1)


def test_what_does_not_belong_together_is_named(tmp_path):
    emitter = RecordingEmitter(mixing(1.0))
    repertoire, state = run(emitter, steps=2)
    with pytest.raises(NichechainError, match="emitter is a MixingEmitter, but must be a RecordingEmitter"):
        from_qdax(mixing(1.0), repertoire, state, tmp_path / "a", bounds=BOUNDS)
    with pytest.raises(NichechainError, match="emitter_state is a NoneType, but must be"):
        from_qdax(emitter, repertoire, None, tmp_path / "a", bounds=BOUNDS)
    with pytest.raises(NichechainError, match="emitter_state is of run 0, which must be of this emitter"):
        from_qdax(RecordingEmitter(mixing(1.0)), repertoire, state, tmp_path / "a", bounds=BOUNDS)
    with pytest.raises(NichechainError, match="outside is 'absorb'"):
        from_qdax(emitter, repertoire, state, tmp_path / "a", bounds=BOUNDS, outside="absorb")
    with pytest.raises(NichechainError, match="centroids have shape"):
        from_qdax(emitter, repertoire, state, tmp_path / "a", bounds=((0, 1),))
    with pytest.raises(NichechainError, match="but must be an emitter of QDax"):
        RecordingEmitter(emitter)
    with pytest.raises(NichechainError, match="block is 0, but must be at least 1"):
        RecordingEmitter(mixing(1.0), block=0)
    with pytest.raises(NichechainError, match=r"tell\(\) must be given what ask\(\) gave"):
        emitter.state_update(state, repertoire, None, None, None, {})

    class Other(MapElitesRepertoire):
        def add(self, *args):
            raise NotImplementedError

    with pytest.raises(NichechainError, match="the repertoire is a Other, but only"):
        emitter.init(None, Other(*jax.tree.leaves(repertoire)[:0], **vars(repertoire)), None, None, None, {})
