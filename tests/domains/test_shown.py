"""What domains tell of themselves, in text and in a notebook."""

import pytest

from nichechain import domains


@pytest.mark.parametrize("name", ["arm", "linear", "cosinus"])
def test_a_table_of_what_a_search_needs_to_know(name):
    domain = domains.make(name, seed=3)
    shown = domain._repr_html_()
    assert repr(domain) in shown
    assert f"{domain.genotype_length} parameters" in shown
    for axis, (low, high) in zip(domain.behavior_names, domain.bounds, strict=True):
        assert f"{axis} from {low:g} to {high:g} {domain.unit}" in shown
    assert "seed=3" in repr(domain)


def test_noise_is_told():
    noisy = domains.Noisy(domains.make("arm"), domains.Noise(action=0.1), repeats=4)
    shown = noisy._repr_html_()
    assert "action=0.1" in shown
    assert "repeats=4" in shown
    assert "10 parameters" in shown
