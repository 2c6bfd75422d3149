"""Command lines that careless people type: one line that says what is wrong, exit code 2, and nothing is started."""

import shlex

import pytest

from cli_tools import complaint

BAG = "bags/samples/track_one_measured"
PICTURE = "docs/pictures/camera.jpg"
LINES = {
    "rnu": "did you mean 'run'?",
    "tset": "did you mean 'test'?",
    "--track one": "no option '--track'",
    "-run": "no option '-run'",
    "run run": "'run' is one argument too many",
    "run --track ''": "no track ''; there are: one,",
    "run --track 2": "no track '2'; there are: one,",
    "run --scenario ''": "'' is no path",
    "run --scenario nope.yaml": "nope.yaml",
    "run --scenario .": "formation run: .",
    "run --bag ''": "'' is no path",
    "run --surface ''": "no surface ''; there are: bowl,",
    "run --predictor ''": "--predictor can't be ''; there are: ",
    "run --seed ''": "--seed: '' is not a whole number",
    "run --seed 1.5": "--seed: '1.5' is not a whole number",
    "run --seed -1": "--seed is -1, outside 0 to ",
    "run --seed 99999999999999999999999": "--seed is 99999999999999999999999, outside 0 to ",
    "run --set": "--set: expected one argument",
    "run --set ''": "--set takes KEY=VALUE",
    "run --set =3": "--set: no entry ''; there are: ",
    "run --set seed=": "'seed' must be of type int, not None",
    "run --set followers=99": "'followers' is 99, outside 1 to 10",
    "run --camera ''": "--camera can't be ''; there are: on_demand, stream",
    "run --real-time-factor inf": "'inf' is not a number",
    "run --images=3": "--images: takes no value, not '3'",
    "run --seed\uff13 3": "did you mean '--seed'?",
    f"run {BAG}": "is one argument too many",
    "analyze": "required: BAG",
    "analyze ''": "'' is no path",
    "analyze README.md": "README.md is not a bag",
    "info nope": "nope doesn't exist",
    "list robot": "did you mean 'robots'?",
    "list --jsno": "did you mean '--json'?",
    "sweep --seeds 0-5": "--seeds takes FIRST:END",
    "sweep --seeds ''": "takes one or several, separated by commas, not ''",
    "sweep --surfaces bowl,": "takes one or several, separated by commas, not 'bowl,'",
    "sweep --jobs -1": "--jobs is at least 1, not -1",
    "predict nope.csv": "nope.csv can't be read",
    f"predict {BAG}": "can't be read: Is a directory",
    f"play {BAG} --rate fast": "--rate: 'fast' is not a number",
    "record --alll": "did you mean '--all'?",
    "recover nope": "nope",
    f"replay {BAG} --seed 3": "no option '--seed'",
    "calibrate motors --surface nope": "no surface 'nope'",
    "calibrate motors --track ''": "no track ''",
    "calibrate vision --step many": "--step: 'many' is not a number",
    f"teach {PICTURE} --point 1": "'1' is not 2 whole numbers",
    f"teach {PICTURE} --point 999,999": "is not inside the 316 x 208 picture",
    "teach nope.png --point 1,2": "nope.png: can't be read",
    "detect nope.png": "nope.png: can't be read",
    f"detect {PICTURE} --signatures nope.yaml": "nope.yaml: can't be read",
    "doctor now": "'now' is one argument too many",
    "test -x": "arguments of pytest come after --",
}


@pytest.mark.parametrize("line", LINES)
def test_a_careless_line_is_answered_with_one_that_helps(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, request: pytest.FixtureRequest, line: str
) -> None:
    monkeypatch.chdir(request.config.rootpath)
    said = complaint(capsys, *shlex.split(line))
    assert LINES[line] in said
    assert len(said) < 300
