"""What `import robot_formation` offers, what it loads, and what the reference page says of it."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest
from matplotlib import pyplot

import robot_formation as rf
from repository import ROOT

PAGE = ROOT / "docs" / "reference" / "python_api.md"
HEAVY = ("cv2", "joblib", "matplotlib", "numpy", "pandas", "pybullet", "rclpy", "rosbags", "scipy", "yaml")


def loaded_by(code: str) -> set[str]:
    """Names of heavy modules that a piece of code imports in a fresh Python."""
    program = f"import sys\nbefore = set(sys.modules)\n{code}\nprint(*(set(sys.modules) - before))"
    result = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr
    return set(result.stdout.split()) & set(HEAVY)


def test_importing_the_package_loads_nothing_heavy() -> None:
    assert loaded_by("import robot_formation as rf; dir(rf); rf.__all__; rf.FormationError") == set()


def test_a_bag_is_analysed_without_what_runs_need() -> None:
    sample = ROOT / "bags" / "samples" / "track_two_formation"
    loaded = loaded_by(f"import robot_formation as rf; rf.analyze({str(sample)!r}).followers['follower_1'].moved")
    assert "numpy" in loaded
    assert loaded & {"pybullet", "rclpy", "cv2", "joblib", "pandas", "matplotlib"} == set()


@pytest.mark.parametrize("code", ["rf.load_scenario('track_two')", "rf.forecast('measured', [[0.0, 0.05]] * 4)"])
def test_scenarios_and_forecasts_need_neither_pybullet_nor_ros(code: str) -> None:
    assert loaded_by(f"import robot_formation as rf; {code}") & {"pybullet", "rclpy", "joblib"} == set()


@pytest.mark.parametrize("name", [name for name in rf.__all__ if name != "__version__"])
def test_a_public_name_is_there_listed_and_described(name: str) -> None:
    found = getattr(rf, name)
    assert name in dir(rf)
    assert (found.__doc__ or "").partition("\n")[0].endswith((".", ":"))
    assert found.__name__ == name


def members(cls: type[Any]) -> set[str]:
    """Public attributes, properties and methods of a class."""
    return {name for name in (*dir(cls), *getattr(cls, "__dataclass_fields__", ())) if not name.startswith("_")}


def test_the_reference_page_names_everything_public_and_nothing_else() -> None:
    text = PAGE.read_text(encoding="utf-8")
    hidden = {"definition", "record", "analysis", "plan", "ranking"}  # of the package's own
    marked = re.findall(r"`([^`]+)`", re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE))
    said = {word for piece in marked for word in re.findall(r"\w+", piece)}
    classes = [rf.Scenario, rf.Run, rf.Leader, rf.Follower, rf.Sweep, rf.Forecasts, rf.Score]
    public = {name for cls in classes for name in members(cls)} - hidden
    assert {name for name in {*rf.__all__, *public} - {"__version__"} if name not in said} == set()
    for owner, name in re.findall(r"\b(Scenario|Run|Sweep|Score)\.(\w+)", text):
        assert name in members(getattr(rf, owner)), f"{owner}.{name}"


def test_a_misspelt_name_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="no attribute 'load_scenari'"):
        rf.load_scenari  # type: ignore[attr-defined]  # noqa: B018


@pytest.mark.slow
def test_the_example_of_the_reference_page_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (example,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    try:
        exec(compile(example, str(PAGE), "exec"), {})  # as a reader would type it
    finally:
        pyplot.close("all")
    said = capsys.readouterr().out
    assert "(5, 2)" in said
    assert "| track_two | bowl | measured | 2 |" in said
    assert (tmp_path / "trajectory.png").stat().st_size > 10_000


def test_the_lists_name_what_there_is_and_what_is_installed(monkeypatch: pytest.MonkeyPatch) -> None:
    from robot_formation import plugins

    assert {"track_one", "track_two", "echelon_of_three"} <= set(rf.scenarios())
    assert {"straight", "circle"} <= set(rf.leader_paths())
    assert {"previous", "measured", "formation"} <= set(rf.predictors())
    assert {"bowl", "plane"} <= set(rf.surfaces())
    added = {"mine": plugins.Plugin("mine", "my_package:Mine", "my-package 1.0")}
    monkeypatch.setattr(plugins, "installed", lambda kind: added)
    for names in (rf.leader_paths(), rf.surfaces(), rf.predictors(), rf.sensors()):
        assert names[-1] == "mine"
        assert len(set(names)) == len(names)
