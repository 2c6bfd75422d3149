"""Misspelt verbs, options and topics: what was probably meant, and the usage of the verb that it belongs to."""

import argparse

import pytest
from _pytest.capture import CaptureResult

from robot_formation.cli.main import main
from robot_formation.cli.option_types import Names, number, whole_number
from robot_formation.cli.parser import Parser


def ended(capsys: pytest.CaptureFixture[str], *arguments: str) -> tuple[int, CaptureResult[str]]:
    with pytest.raises(SystemExit) as leave:
        main(list(arguments))
    assert isinstance(leave.value.code, int)
    return leave.value.code, capsys.readouterr()


@pytest.mark.parametrize(
    ("arguments", "verb", "words"),
    [
        (("rnu",), "formation", "no verb 'rnu'; did you mean 'run'?"),
        (("RUN",), "formation", "no verb 'RUN'; did you mean 'run'?"),
        (("help",), "formation", "did you mean 'formation --help'?"),
        (("",), "formation", "no verb ''; there are: analyze, animate, calibrate, "),
        (("run", "--sed", "3"), "formation run", "no option '--sed'; did you mean '--seed'?"),
        (("run", "-seed", "3"), "formation run", "no option '-seed'; did you mean '--seed'?"),
        (("run", "--sed=3"), "formation run", "no option '--sed'; did you mean '--seed'?"),
        (("run", "--x"), "formation run", "no option '--x'; 'formation run --help' lists them"),
        (("run", "sweep"), "formation run", "'sweep' is one argument too many"),
        (("run", "track=one"), "formation run", "did you mean '--track'?"),
        (("teach", "a.png", "--regoin", "1,2,3,4"), "formation teach", "did you mean '--region'?"),
        (("list", "track"), "formation list", "no 'track'; did you mean 'tracks'?"),
        (("calibrate", "motor"), "formation calibrate", "no 'motor'; did you mean 'motors'?"),
        (("calibrate", "motors", "--repets", "3"), "formation calibrate motors", "did you mean '--repeats'?"),
        (("detect", "a.png", "--sensor", "tag"), "formation detect", "--sensor: can't be 'tag'; did you mean 'tags'?"),
        (("teach", "a.png", "--point", "1,2", "--signature", "9"), "formation teach", "there are: 1, 2, 3, 4, 5, 6, 7"),
        (("test", "-k", "x"), "formation test", "arguments of pytest come after --"),
        (("run", "--seed", "x"), "formation run", "--seed: 'x' is not a whole number"),
        (("run", "--real-time-factor", "nan"), "formation run", "'nan' is not a number"),
    ],
)
def test_what_is_misspelt_is_named_under_the_usage_of_its_own_verb(
    capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...], verb: str, words: str
) -> None:
    code, said = ended(capsys, *arguments)
    assert (code, said.out) == (2, "")
    lines = said.err.splitlines()
    assert lines[0].startswith(f"usage: {verb} [-h]")
    assert lines[-1].startswith(f"{verb}: error: ")
    assert words in lines[-1]


@pytest.mark.parametrize("arguments", [(), ("calibrate",)], ids=["formation", "formation calibrate"])
def test_without_a_verb_the_help_is_printed(capsys: pytest.CaptureFixture[str], arguments: tuple[str, ...]) -> None:
    code, said = ended(capsys, *arguments)
    assert (code, said.err) == (0, "")
    assert said.out.startswith(f"usage: {' '.join(['formation', *arguments])} [-h]")


def test_help_is_given_whatever_else_is_misspelt(capsys: pytest.CaptureFixture[str]) -> None:
    code, said = ended(capsys, "run", "--sed", "3", "--help")
    assert code == 0
    assert "--seed" in said.out


def test_a_very_long_word_is_shortened(capsys: pytest.CaptureFixture[str]) -> None:
    _, said = ended(capsys, "run", "x" * 5000)
    assert len(said.err.splitlines()[-1]) < 200


@pytest.fixture
def parser() -> Parser:
    made = Parser(prog="program")
    made.add_argument("-o", "--out")
    made.add_argument("--seed", type=whole_number)
    made.add_argument("--factor", type=number)
    made.add_argument("--names", action=Names, default=("one", "two"))
    made.add_argument("words", nargs="*")
    return made


@pytest.mark.parametrize(
    "arguments",
    [
        ["--see", "3"],
        ["-ofile"],
        ["--factor", "-1e-3"],
        ["--seed", "-1"],
        ["-o", "-"],
        ["a", "--", "--nothing"],
        ["--out", "-two words"],
    ],
)
def test_what_argparse_takes_is_taken(parser: Parser, arguments: list[str]) -> None:
    plain = argparse.ArgumentParser(prog="program", parents=[parser], add_help=False, conflict_handler="resolve")
    try:
        expected = plain.parse_args(arguments)
    except SystemExit:
        with pytest.raises(SystemExit):
            parser.parse_args(arguments)
    else:
        assert parser.parse_args(arguments) == expected


@pytest.mark.parametrize(
    ("arguments", "names"),
    [
        ([], ("one", "two")),
        (["--names", "a"], ("a",)),
        (["--names", "a, b"], ("a", "b")),
        (["--names", "a", "--names", "b,c"], ("a", "b", "c")),
        (["--names", "b,a,b", "--names", "a"], ("b", "a")),
        (["--names", "one"], ("one",)),
    ],
)
def test_names_add_up_and_count_once(parser: Parser, arguments: list[str], names: tuple[str, ...]) -> None:
    assert parser.parse_args(arguments).names == names


@pytest.mark.parametrize("text", ["", ",", "a,", "a,,b", " "])
def test_empty_names_are_refused(parser: Parser, capsys: pytest.CaptureFixture[str], text: str) -> None:
    with pytest.raises(SystemExit):
        parser.parse_args(["--names", text])
    assert "takes one or several, separated by commas" in capsys.readouterr().err
