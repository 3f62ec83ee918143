import os

import gymnasium
import numpy as np
import pytest

from nichechain.core.errors import NichechainError
from nichechain.domains import FetchPickAndPlace, Film, GymDomain, LinearMap, Motion, PlanarArm, watching
from nichechain.domains.base import Wrapper
from nichechain.domains.watching import offscreen, offscreen_backend, watch


def test_arm_ends_in_its_posture():
    arm = PlanarArm(joints=3)
    angles = [0.3, -0.7, 1.1]
    motion = watch(arm, angles)
    assert isinstance(motion, Motion)
    np.testing.assert_allclose(motion.limbs[0], [[0, 0], [1 / 3, 0], [2 / 3, 0], [1, 0]], atol=1e-12)
    hand = arm.evaluate([angles]).behavior[0]
    np.testing.assert_allclose(motion.tracks["hand"][-1], hand, atol=1e-6)
    lengths = np.linalg.norm(np.diff(motion.limbs, axis=1), axis=2)
    np.testing.assert_allclose(lengths, 1 / 3, rtol=1e-12)
    assert len(motion) == len(motion.tracks["hand"])


def test_what_wraps_a_domain_is_seen_through():
    inner = PlanarArm(joints=2)
    assert isinstance(watch(Wrapper(inner), [0.1, 0.2]), Motion)


def test_a_domain_without_the_method_says_so():
    with pytest.raises(NichechainError, match="cannot be watched: its domain has no method watch"):
        watch(LinearMap(), [0.0, 0.0])


@pytest.mark.parametrize(
    ("genotype", "said"), [([0.1], r"shape \(1,\), but must be \(2,\)"), ([np.nan, 0.0], "is not finite")]
)
def test_bad_genotypes(genotype, said):
    with pytest.raises(NichechainError, match=said):
        watch(PlanarArm(joints=2), genotype)


def test_drawn_block_ends_where_behavior_says():
    task = FetchPickAndPlace()
    genotype = task.sample(1, seed=3)[0]
    motion = watch(task, genotype, drawn=True)
    assert list(motion.tracks) == ["gripper", "block"]
    assert len(motion) == task.steps + 1
    np.testing.assert_array_equal(motion.tracks["block"][-1], task.evaluate(genotype[None]).behavior[0])


def test_without_a_renderer_places_are_given(monkeypatch):
    monkeypatch.setattr("nichechain.domains.fetch.offscreen_backend", lambda: None)
    task = FetchPickAndPlace()
    assert isinstance(watch(task, task.sample(1, seed=3)[0]), Motion)


def test_no_renderer_is_said_in_one_sentence(monkeypatch):
    monkeypatch.setattr(watching, "offscreen_backend", lambda: None)
    with pytest.raises(NichechainError, match="install EGL or OSMesa"), offscreen():
        pass


def test_the_variable_is_put_back(monkeypatch):
    monkeypatch.setattr(watching, "offscreen_backend", lambda: "osmesa")
    monkeypatch.delenv("MUJOCO_GL", raising=False)
    with offscreen():
        assert os.environ["MUJOCO_GL"] == "osmesa"
    assert "MUJOCO_GL" not in os.environ


def test_fetch_is_filmed_where_there_is_a_renderer():
    if offscreen_backend() is None:
        pytest.skip("MuJoCo has no renderer here that needs no screen (Debian: libegl1 or libosmesa6)")
    from nichechain.domains.engine.pictures import SIDE, fetch_pictures

    frames = fetch_pictures("FetchPickAndPlace-v4", 0, np.ones((2, 4), np.float32))
    assert frames.shape == (3, SIDE, SIDE, 3)
    assert frames.std() > 10.0
    assert (frames[0] != frames[-1]).any()


class Counter(gymnasium.Env):
    """Counts its steps, and shows the number as a shade of grey."""

    metadata = {"render_modes": ["rgb_array"], "render_fps": 5}  # noqa: RUF012  # Gymnasium's habit
    observation_space = gymnasium.spaces.Box(-1.0, 9.0, (2,), np.float64)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,), np.float32)

    def __init__(self, render_mode=None):
        self.render_mode = render_mode
        self.count = 0

    def reset(self, *, seed=None, options=None):  # noqa: ARG002  # as Gymnasium calls it
        super().reset(seed=seed)
        self.count = 0
        return np.zeros(2), {}

    def step(self, action):
        self.count += 1
        return np.array([self.count, action[0]], float), 0.0, False, False, {}

    def render(self):
        return np.full((6, 8, 3), 10 * self.count, np.uint8)


class Blind(Counter):
    metadata = {"render_modes": []}  # noqa: RUF012  # Gymnasium's habit


@pytest.fixture
def registered():
    for name, kind in (("NichechainCounter-v0", Counter), ("NichechainBlind-v0", Blind)):
        gymnasium.register(name, kind, max_episode_steps=3)
    yield
    for name in ("NichechainCounter-v0", "NichechainBlind-v0"):
        del gymnasium.registry[name]


@pytest.mark.usefixtures("registered")
def test_environments_are_filmed_by_their_own_renderer():
    domain = GymDomain(
        "NichechainCounter-v0",
        lambda episode: episode.observations[-1],
        bounds=((-1, 9), (-1, 1)),
        controller="mlp:2",
    )
    film = watch(domain, domain.sample(1, seed=0)[0])
    assert isinstance(film, Film)
    assert film.rate == 5.0
    assert film.frames.shape == (4, 6, 8, 3)
    assert film.frames[:, 0, 0, 0].tolist() == [0, 10, 20, 30]
    with pytest.raises(NichechainError, match="cannot be drawn"):
        watch(domain, domain.sample(1, seed=0)[0], drawn=True)


@pytest.mark.usefixtures("registered")
def test_an_environment_without_pictures_says_so():
    domain = GymDomain(
        "NichechainBlind-v0",
        lambda episode: episode.observations[-1],
        bounds=((-1, 9), (-1, 1)),
        controller="mlp:2",
    )
    with pytest.raises(NichechainError, match="has no render_mode rgb_array"):
        watch(domain, domain.sample(1, seed=0)[0])
