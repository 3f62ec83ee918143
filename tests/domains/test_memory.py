"""Memory for caches: as text, in bytes, and through what is wrapped around a domain."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

from nichechain import NichechainError, domains
from nichechain.domains import FetchPickAndPlace, PlanarArm
from nichechain.domains.memory import CACHE_MEMORY, cache_memory_of, limit_cache, parse_memory
from nichechain.domains.noise import Noise, Noisy
from nichechain.execution import Processes, Threads, make
from nichechain.execution.fleet import Workbench


@pytest.mark.parametrize(
    ("text", "size"),
    [("0", 0), ("12", 12), ("500MB", 500_000_000), ("2GiB", 2 * 2**30), ("1.5 kib", 1536), ("7b", 7)],
)
def test_sizes_as_text(text: str, size: int) -> None:
    assert parse_memory(text) == size


@pytest.mark.parametrize(
    "text", ["", "-1", "1e9", "two", "2TB", "1.5.2GB", "GB", "nan", "2 GB x", "\u0662GB"]
)
def test_what_is_no_size(text: str) -> None:
    with pytest.raises(NichechainError, match="cache_memory is"):
        parse_memory(text)


def test_limits_reach_the_innermost_domain() -> None:
    inner = FetchPickAndPlace()
    outer = Noisy(inner, Noise(action=0.1), repeats=2)
    assert cache_memory_of(outer) == CACHE_MEMORY
    limit_cache(outer, 1000)
    assert inner.cache_memory == cache_memory_of(outer) == 1000


def test_a_domain_without_a_cache_has_no_memory_to_limit() -> None:
    arm = PlanarArm()
    limit_cache(arm, 1000)
    assert cache_memory_of(arm) == 0
    assert not hasattr(arm, "cache_memory")


def test_memory_is_not_of_what_a_domain_is() -> None:
    with pytest.raises(NichechainError, match="has no option 'cache_memory'"):
        domains.make("fetch", cache_memory=5)


def test_threads_limit_the_domain_and_keep_what_it_holds() -> None:
    domain = FetchPickAndPlace()
    genotypes = (100.0 * domain.sample(1, seed=0)).astype(np.float32)
    with Threads(1, cache_memory=10**6) as executor:
        first = executor.evaluate(domain, genotypes)
        again = executor.evaluate(domain, genotypes)
    assert domain.cache_memory == 10**6
    assert (first.known, again.known) == (0, 50)
    with make("1", "0") as executor:
        off = executor.evaluate(domain, genotypes)
    assert off.known == 0
    np.testing.assert_array_equal(off.behavior, again.behavior)


def test_processes_share_what_there_is() -> None:
    with Processes(3, cache_memory=3000) as executor:
        executor.evaluate(PlanarArm(), np.zeros((1, 10), np.float32))
        assert executor._cache_share == 1000
    bench = Workbench(pickle.dumps(FetchPickAndPlace()), 1000)
    assert bench.prepare() is None
    assert bench._domain is not None
    assert cache_memory_of(bench._domain) == 1000


def test_a_negative_memory_needs_no_cluster() -> None:
    with pytest.raises(NichechainError, match="cache_memory is '-1'"):
        make("ray", "-1")
