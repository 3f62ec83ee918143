"""The domain author's guide: its code runs, and its first example is a domain."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from nichechain.cli.build import BuildCommand
from nichechain.cli.parsing import parse
from nichechain.search.making import make_domain

GUIDE = Path(__file__).parents[1] / "docs" / "own_domain.md"
TEXT = GUIDE.read_text(encoding="utf-8")


def blocks(language):
    return re.findall(rf"^```{language}\n(.*?)^```", TEXT, re.MULTILINE | re.DOTALL)


@pytest.fixture(scope="module")
def names(tmp_path_factory):
    """What the guide's Python defines, one block after another as a reader runs them."""
    folder = tmp_path_factory.mktemp("guide")
    found = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for block in blocks("python"):
            exec(compile(block, GUIDE.name, "exec"), found)
    return found


def test_the_example_is_a_domain_of_twenty_lines(names):
    # All of the protocol but controller(), which only a domain with a policy has.
    table = TEXT[TEXT.index("| attribute |") : TEXT.index("### The one law")]
    first_cells = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    attributes = [name for cell in first_cells for name in re.findall(r"`(\w+)", cell)]
    assert {"name", "unit", "sample", "evaluate", "controller"} <= set(attributes)
    assert [name for name in attributes if not hasattr(names["room"], name)] == ["controller"]
    source = blocks("python")[0]
    body = source[source.index("class Thermostat") : source.index("room = Thermostat")]
    assert sum(bool(line.strip()) for line in body.splitlines()) <= 25


def test_the_example_fills_an_archive(names):
    archive = names["archive"]
    assert archive.meta.births == 2000
    assert archive.filled > 40
    again = names["room"].evaluate(archive.elites.genotype)
    np.testing.assert_array_equal(again.behavior, archive.elites.behavior)


def test_a_thermostat_that_does_nothing_cools_to_the_outside(names):
    """Without heat the temperature falls from 10 towards 5 by a twentieth of the difference a step."""
    evaluation = names["room"].evaluate(np.zeros((1, 2)))
    np.testing.assert_allclose(evaluation.behavior[0, 0], 5 + 5 * 0.95, rtol=1e-12)
    np.testing.assert_allclose(evaluation.behavior[0, 1], 5 * (0.95**151 - 0.95**200), rtol=1e-9)
    np.testing.assert_allclose(evaluation.objective[0], -(15 - 5 * 0.95**200), rtol=1e-12)


def test_an_ants_feet_are_four_shares(names):
    ant = names["ant"]
    assert len(ant.behavior_names) == 4
    assert ant.bounds == ((0.0, 1.0),) * 4


def test_the_commands_ask_for_builds():
    commands = [shlex.split(line) for block in blocks("sh") for line in block.splitlines()]
    assert len(commands) == 3
    for words in commands:
        assert words[:2] == ["nichechain", "build"]
        config = parse(BuildCommand, words[2:]).config()
        assert config.domain_options
        assert repr(make_domain(config))
