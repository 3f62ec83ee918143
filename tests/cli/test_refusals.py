"""What the parser of options refuses is said in one sentence, as everything else is."""

import pytest

from nichechain.cli import main, parsing
from nichechain.cli.refusals import of_options, sentence

SAID = {
    "plot a wormhole": "kind is 'wormhole', but must be one of elites, visits, ",
    "plot a wormhol": "; did you mean wormholes? (see nichechain plot --help)",
    "build arm --evaluations three": "--evaluations is 'three', but must be a whole number (see nichechain ",
    "build arm --scale big": "--scale is 'big', but must be a number",
    "build arm --evaluation 3": "there is no option --evaluation; did you mean --evaluations?",
    "build": "DOMAIN must be given",
    "evolvability a --top three": "--top is 'three', but must be a whole number",
    "evolvability a --rank nich": "--rank is 'nich', but must be one of elites, niches; did you mean niches?",
    "evolvability a b": "there is no argument b",
    "evolvability a --uncertainty": "--uncertainty needs a value",
    "walks pressure arm": "--out must be given",
    "evolvabilty a": "; did you mean evolvability?",
    "info fetch-pick-and-plac": "; did you mean fetch-pick-and-place?",
}


@pytest.mark.parametrize(("line", "said"), SAID.items())
def test_one_sentence(line, said, capsys, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    assert main(line.split()) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    assert shown.err.startswith("nichechain: error: ")
    assert shown.err.count("\n") == 1
    assert said in shown.err


def test_a_parameter_of_the_library_is_said_as_the_option_that_gave_it():
    assert of_options("elites is 2, but", ["validate", "a", "--elites", "2"]) == "--elites is 2, but"
    assert of_options("min_births is -1, but", ["table", "--min-births=-1"]) == "--min-births is -1, but"
    assert of_options("level is 'hard', but", ["walks", "--levels", "hard"]) == "--levels is 'hard', but"
    for other in ("elites is 2, but", "--elites is 2, but", "meta.json: elites is 2", "there is no x"):
        assert of_options(other, ["validate", "a", "--elite", "2"]) == other


@pytest.mark.parametrize(
    ("line", "said"),
    {
        "validate {} --elites 2": "--elites is 2, but a rank correlation needs at least 3",
        "landscape {} --elites 0": "--elites is 0, but must be at least 1",
        "landscape {} --offspring 1": "--offspring is 1, but must be at least 2",
        "evolvability {} --l 0": "--l is 0, but",
        "build arm --seed 3 --domain-seed -1": "--domain-seed is -1, but",
    }.items(),
)
def test_options_are_named_in_what_the_library_refuses(line, said, built, capsys):
    assert main([str(built) if word == "{}" else word for word in line.split()]) == 2
    assert capsys.readouterr().err.startswith(f"nichechain: error: {said}")


def test_an_archive_of_ones_own(built, capsys):
    near = built.with_name(built.name + "s")
    assert main(["info", str(near)]) == 2
    assert f"did you mean {built}?" in capsys.readouterr().err


def test_what_is_no_refusal_has_no_sentence():
    assert sentence("something else\n", "nichechain build") is None


@pytest.mark.parametrize(
    ("text", "value"),
    [("1e4", 10_000), ("2.5e3", 2500), ("1E+2", 100), ("-2e1", -20), ("12", 12), ("1_000", 1000)],
)
def test_powers_of_ten_are_whole_numbers(text, value):
    assert parsing.whole(text) == value


@pytest.mark.parametrize("text", ["1.5", "1.25e1", "1e-2", "e4", "1e", "1e999", "nan", ""])
def test_what_is_no_whole_number(text):
    with pytest.raises(ValueError, match="invalid literal"):
        parsing.whole(text)


def test_a_power_of_ten_on_the_command_line(built, capsys):
    assert main(["evolvability", str(built), "--l", "2e0", "--lineages", "1e1", "--draws", "2"]) == 0
    assert "10 lineages of 2 generations" in capsys.readouterr().out


def test_frames_of_colour_and_of_ascii():
    plain = (
        " Missing argument \n ----------- \n  Missing value for argument '--l'.\n  ---------\n  For help\n"
    )
    framed = (
        "╭─ Missing argument ─╮\n│ \x1b[1mMissing value for argument '--l'.\x1b[0m │\n│ ───────── │\n╰───╯\n"
    )
    for text in (plain, framed):
        assert sentence(text, "nichechain plot") == "--l needs a value (see nichechain plot --help)"
