"""From a configuration to operator and domain; layers of controllers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from torch import nn

from nichechain import BuildConfig, NichechainError, domains, variation
from nichechain.domains import PlanarArm
from nichechain.domains.base import Wrapper
from nichechain.domains.policies.controllers import MLP, ModuleController
from nichechain.search.making import make_mutation
from nichechain.variation import AdditiveMutation, Bound, SelfAdaptiveDomain, SelfAdaptiveMutation
from nichechain.variation.additive import layers_of, parse_layer_scales, parse_step_bound
from nichechain.variation.noise import CauchyNoise, StudentTNoise

CONFIG = BuildConfig("arm", (4, 4), PlanarArm.bounds, scale=0.5)
FETCH = domains.make("fetch")


class LayeredArm(PlanarArm):
    layers = (4, 6)


def test_a_plain_configuration_gives_the_plain_operator():
    arm = PlanarArm()
    domain, mutate = make_mutation(CONFIG, arm)
    assert domain is arm
    assert mutate == variation.make("cauchy", 0.5)


def test_every_option_arrives():
    config = replace(CONFIG, mutation="student-t", df=5, step_bound=("rescaled", 3), layer_scales=(2, 0.1))
    _, mutate = make_mutation(config, LayeredArm())
    assert mutate == AdditiveMutation(StudentTNoise(5), 0.5, Bound("rescaled", 3.0), (4, 6), (2.0, 0.1))
    domain, mutate = make_mutation(replace(config, self_adaptive=True), LayeredArm())
    assert isinstance(domain, SelfAdaptiveDomain)
    assert domain.step_sizes == (1.0, 0.05)
    assert mutate == SelfAdaptiveMutation(StudentTNoise(5), (4, 6), Bound("rescaled", 3.0))


def test_without_layer_scales_there_is_one_step_size():
    domain, mutate = make_mutation(replace(CONFIG, self_adaptive=True), PlanarArm())
    assert domain.genotype_length == 11
    assert mutate == SelfAdaptiveMutation(CauchyNoise(), (10,))


def test_a_configuration_survives_json():
    config = replace(CONFIG, step_bound=("per-coordinate", 2), layer_scales=(1, 0.5), self_adaptive=True)
    text = config.to_json()
    assert BuildConfig.from_json({**text, "step_bound": ["per-coordinate", 2.0]}) == config
    new = ("df", "step_bound", "layer_scales", "self_adaptive", "selection")
    older = {name: value for name, value in CONFIG.to_json().items() if name not in new}
    assert BuildConfig.from_json(older) == CONFIG


def test_layers_of_controllers_are_slices_of_their_genotypes():
    assert MLP().layers == (25 * 32, 32 * 32, 32 * 4)
    assert MLP(evolve_biases=True).layers == (26 * 32, 33 * 32, 33 * 4)
    assert layers_of(FETCH) == layers_of(Wrapper(FETCH)) == (800, 1024, 128)
    module = nn.Sequential(nn.Linear(3, 5), nn.Tanh(), nn.Sequential(nn.Linear(5, 2, bias=False), nn.ReLU()))
    assert ModuleController(module, 3, 2).layers == (20, 10)


def test_a_parameter_that_layers_share_is_one_gene():
    first, second = nn.Linear(3, 3), nn.Linear(3, 3, bias=False)
    second.weight = first.weight
    controller = ModuleController(nn.Sequential(first, second), 3, 3)
    assert controller.layers == (12,)
    assert controller.genotype_length == 12


def test_layers_of_a_module_follow_the_order_of_its_genotype():
    module = nn.Sequential(nn.Linear(2, 3), nn.Linear(3, 4))
    controller = ModuleController(module, 2, 4)
    genotype = np.zeros(controller.genotype_length, np.float32)
    genotype[controller.layers[0] :] = 1.0
    first, second = controller.module(genotype)
    assert not any(parameter.any() for parameter in first.parameters())
    assert all(bool((parameter == 1).all()) for parameter in second.parameters())


@pytest.mark.parametrize(
    ("changes", "domain", "message"),
    [
        ({"layer_scales": (1.0,)}, PlanarArm(), "arm has no layers, so it takes one scale"),
        ({"layer_scales": (1.0, 2.0)}, FETCH, r"layer scales are 1, 2, but there are 3 layers"),
        (
            {"layer_scales": (1.0, 2.0)},
            LayeredArm(9),
            "have 10 parameters together, but its genotypes have 9",
        ),
        ({"df": 2.0}, PlanarArm(), "only student-t has"),
        ({"step_bound": ("rescaled", -1)}, PlanarArm(), "step_bound is -1"),
        ({"step_bound": ("cube", 1)}, PlanarArm(), "kind of step bound is 'cube'"),
        ({"mutation": "levy"}, PlanarArm(), "mutation is 'levy'"),
    ],
)
def test_what_does_not_fit_is_named(changes, domain, message):
    with pytest.raises(NichechainError, match=message):
        make_mutation(replace(CONFIG, **changes), domain)


def test_options_are_read_from_text():
    assert parse_step_bound("per-coordinate:2") == ("per-coordinate", 2.0)
    assert parse_step_bound("rescaled:1e-3") == ("rescaled", 0.001)
    assert parse_layer_scales("1,0.5,2e-1") == (1.0, 0.5, 0.2)


@pytest.mark.parametrize("text", ["", "2", "rescaled", "rescaled:", "rescaled:x", "rescaled:-1", "cube:1"])
def test_a_bad_bound_is_named(text):
    with pytest.raises(NichechainError, match=r"step_bound is .* must be per-coordinate:SIZE"):
        parse_step_bound(text)


@pytest.mark.parametrize("text", ["", "1,", "1;2", "1,-2", "0", "nan", "1,inf"])
def test_bad_layer_scales_are_named(text):
    with pytest.raises(NichechainError, match=r"layer_scales is .* must be positive numbers"):
        parse_layer_scales(text)
