"""What a build is told of its domain, there and back."""

import pytest

import nichechain as nc
from nichechain.cli import main
from nichechain.cli.build import BuildCommand
from nichechain.cli.parsing import parse


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ([], {}),
        (["--options", "joints=20"], {"joints": 20}),
        (["--options", "a=0.5", "b=true", "c=false", "d=x=y,z", "e="],
         {"a": 0.5, "b": True, "c": False, "d": "x=y,z", "e": ""}),
        (["--noise", "action:0.1", "--repeats", "3"], {"noise": "action:0.1", "repeats": 3}),
        (["--controller", "mlp:8", "--options", "controller=mlp:9"], {"controller": "mlp:8"}),
    ],
)  # fmt: skip
def test_options_of_the_domain(words, expected):
    assert parse(BuildCommand, ["arm", *words]).domain_options() == expected


def test_bounds_of_an_environment_are_told_to_it():
    words = ["gym:Swimmer-v5", "--bounds=-1,1,-2,2", "--steps", "20"]
    config = parse(BuildCommand, words).config()
    assert config.domain_options == {"bounds": "-1,1,-2,2", "steps": 20}
    assert config.bounds == ((-1.0, 1.0), (-2.0, 2.0))


def test_bounds_of_an_environment_with_sensitivity_as_a_third_axis():
    words = ["gym:Swimmer-v5", "--bounds=-1,1,-2,2", "--noise", "action:0.1", "--grid", "4x4x4"]
    config = parse(BuildCommand, [*words, "--options", "axes=x,y,sensitivity"]).config()
    assert config.bounds == ((-1.0, 1.0), (-2.0, 2.0), (0.0, 0.5))
    again = parse(BuildCommand, ["gym:Swimmer-v5"], default=BuildCommand.of(config))
    assert again.config() == config


@pytest.mark.parametrize(
    "words",
    [
        ["arm", "--options", "joints=7", "noise=action:0.25", "repeats=2"],
        ["fetch-reach", "--controller", "mlp-tanh:4", "--options", "evolve_biases=true"],
        ["gym:CartPole-v1", "--descriptor", "final-observation:0,2", "--bounds=-1,1,-1,1"],
    ],
)
def test_a_configuration_asks_for_itself(words):
    config = parse(BuildCommand, words).config()
    assert nc.BuildConfig.from_json(config.to_json()) == config
    assert parse(BuildCommand, words[:1], default=BuildCommand.of(config)).config() == config


def test_the_folder_of_an_environment_is_a_plain_name():
    assert parse(BuildCommand, ["gym:ALE/Pong-v5"]).folder_of(3).parts == (
        "archives",
        "gym-ALE-Pong-v5-seed3",
    )


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["arm", "--options", "joints"], "option 'joints' of the domain must be NAME=VALUE"),
        (["arm", "--options", "=3"], "option '=3' of the domain must be NAME=VALUE"),
        (["arm", "--options", "links=3"], "arm has no option 'links': it has joints"),
        (["arm", "--descriptor", "final-xy"], "arm has no option 'descriptor'"),
        (["gym:Swimmer-v5"], "has no finite bounds of behavior of its own: give bounds"),
        (["gym:Swimmer-v5", "--bounds=-1,1"], "bounds of 1 axes of behavior, but 2 axes"),
        (["cosinus"], "--grid is '20x20', but cosinus has 1 axes of behavior"),
    ],
)
def test_bad_input_is_one_sentence(words, message, capsys, tmp_path):
    assert main(["build", *words, "--out", str(tmp_path / "a")]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "a").exists()


def test_an_archive_of_a_toy_map(tmp_path):
    folder = tmp_path / "toy"
    words = ["cosinus", "--grid", "50", "--mutation", "gaussian", "--scale", "0.5", "--evaluations", "1500"]
    assert main(["build", *words, "--out", str(folder)]) == 0
    archive = nc.load(folder)
    # Every behavior in [-5, 5] is within reach.
    assert archive.filled > 40


@pytest.mark.parametrize(
    "options", [{"a": None}, {"a": [1]}, {1: "a"}, {"a": {}}, {"a": float("nan")}, [("a", 1)]]
)
def test_options_that_json_could_not_keep(options):
    with pytest.raises(nc.NichechainError, match=r"^domain.option"):
        nc.BuildConfig("arm", (4, 4), ((-1, 1), (-1, 1)), domain_options=options)


def test_options_are_kept_in_the_order_of_their_names():
    config = nc.BuildConfig("arm", (4, 4), ((-1, 1), (-1, 1)), domain_options={"b": 1, "a": "x"})
    assert list(config.domain_options) == ["a", "b"]
    assert hash(config) == hash(nc.BuildConfig("arm", (4, 4), ((-1, 1), (-1, 1))))


def test_an_archive_from_before_there_were_options():
    values = nc.BuildConfig("arm", (4, 4), ((-1, 1), (-1, 1))).to_json()
    del values["domain_options"]
    assert nc.BuildConfig.from_json(values).domain_options == {}
