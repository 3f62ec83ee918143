"""Domains by name, with those of other packages."""

from __future__ import annotations

from importlib.metadata import EntryPoint, EntryPoints

import numpy as np
import pytest

import nichechain as nc
from nichechain import domains
from nichechain.core.errors import NichechainError
from nichechain.domains import Noisy, PlanarArm, WithSensitivity, registry
from nichechain.search.making import make_domain

OWN = ("arm", "cosinus", "fetch", "fetch-push", "fetch-reach", "fetch-slide", "linear")


class Catapult(PlanarArm):
    """A domain of another package."""

    name = "catapult"

    def __init__(self, *, seed=0, weight=3):
        super().__init__(joints=weight, seed=seed)


def impostor(**options):
    raise AssertionError(f"fetch is ours, whatever is installed: {options}")


@pytest.fixture
def installed(monkeypatch):
    """As if a package with these entry points were installed."""
    points = EntryPoints(
        EntryPoint(name, value, "nichechain.domains")
        for name, value in {
            "catapult": f"{__name__}:Catapult",
            "fetch": f"{__name__}:impostor",
            "broken": "no_such_package:Domain",
        }.items()
    )
    monkeypatch.setattr(registry, "entry_points", lambda group: points.select(group=group))
    import sys

    monkeypatch.setitem(sys.modules, __name__, sys.modules[Catapult.__module__])


def test_names_are_sorted_and_our_own():
    assert set(OWN) <= set(domains.names())
    assert list(domains.names()) == sorted(domains.names())


@pytest.mark.parametrize("name", OWN)
def test_every_name_makes_a_domain_of_that_name(name):
    domain = domains.make(name, seed=6)
    assert isinstance(domain, domains.Domain)
    assert (domain.name, domain.seed) == (name, 6)
    assert len(domain.bounds) == len(domain.behavior_names)


@pytest.mark.usefixtures("installed")
def test_other_packages_add_domains():
    assert domains.names() == tuple(sorted({*OWN, "broken", "catapult"}))
    made = domains.make("catapult", seed=2, weight=5)
    assert (made.name, made.seed, made.genotype_length) == ("catapult", 2, 5)
    noisy = domains.make("catapult", noise="action:0.1", repeats=3)
    assert isinstance(noisy, Noisy)
    assert noisy.repeats == 3
    assert type(domains.make("fetch")).__name__ == "FetchPickAndPlace"


@pytest.mark.usefixtures("installed")
def test_an_archive_of_another_packages_domain(tmp_path):
    config = nc.BuildConfig(
        "catapult", (5, 5), ((-1, 1), (-1, 1)), evaluations=150, domain_options={"weight": 4}
    )
    with nc.Threads(1) as executor:
        nc.build(config, tmp_path, executor)
    archive = nc.load(tmp_path)
    assert archive.elites.genotype.shape[1] == 4
    np.testing.assert_array_equal(
        archive.domain.evaluate(archive.elites.genotype).behavior, archive.elites.behavior
    )


@pytest.mark.usefixtures("installed")
@pytest.mark.parametrize(
    ("name", "options", "message"),
    [
        ("ant", {}, "domain is 'ant', but must be one of arm, broken, catapult, .* or gym:ENV_ID"),
        ("Arm", {}, "domain is 'Arm', .* or gym:ENV_ID; did you mean arm?"),
        ("Gym:Swimmer-v5", {}, "did you mean gym:Swimmer-v5?"),
        ("broken", {}, "domain broken cannot be imported from no_such_package:Domain"),
        ("catapult", {"joints": 3}, "catapult has no option 'joints': it has weight, noise, repeats"),
        ("arm", {"joints": 0}, "joints is 0"),
        ("arm", {"joints": "many"}, "joints is 'many', but must be a whole number"),
        ("arm", {"repeats": 3}, "arm has nothing random without noise"),
        ("arm", {"noise": "wind:1"}, "noise is 'wind:1'"),
        ("arm", {"noise": "action:1", "repeats": 0}, "repeats is 0"),
        ("arm", {"noise": "action:1", "axes": "x"}, "but must be sensitivity and some of x, y"),
    ],
)
def test_bad_input_is_one_sentence(name, options, message):
    with pytest.raises(NichechainError, match=message):
        domains.make(name, **options)


def test_options_for_every_domain():
    domain = domains.make(
        "arm", seed=4, joints=20, noise="action:0.1", repeats=7, axes="y, sensitivity", most_sensitivity=0.3
    )
    assert isinstance(domain, WithSensitivity)
    assert domain.bounds == ((-1.0, 1.0), (0.0, 0.3))
    assert domain.genotype_length == 20
    assert domains.make("arm", noise="action:0.1").repeats == 5


def test_of_a_build():
    config = nc.BuildConfig("arm", (4, 4), ((-1, 1), (-1, 1)), domain_seed=3, domain_options={"joints": 6})
    assert repr(make_domain(config)) == "PlanarArm(joints=6, seed=3)"
