import numpy as np
import pytest

import nichechain as nc


def local_chain(states=20):
    """Mostly a walk on a circle that stays, with a way back to state 0."""
    matrix = np.zeros((states, states))
    here = np.arange(states)
    matrix[here, here] = 0.6
    matrix[here, (here + 1) % states] += 0.2
    matrix[here, (here - 1) % states] += 0.15
    matrix[here, 0] += 0.05
    return nc.NicheChain(matrix)


def scattered_chain(rng, states=20):
    """Rows drawn at random, few states to a row."""
    return nc.NicheChain(rng.dirichlet(np.full(states, 0.3), states))


@pytest.fixture(scope="session")
def arm(tmp_path_factory):
    """A small archive of the arm, with an outside state that is visited."""
    folder = tmp_path_factory.mktemp("validation") / "arm"
    config = nc.BuildConfig("arm", (8, 8), ((-0.7, 0.9), (-0.9, 0.9)), evaluations=2000, scale=0.2, seed=3)
    with nc.Threads(1) as threads:
        nc.build(config, folder, threads)
    return nc.load(folder)
