"""The launch file's arguments: settings in one text, complaints by their names."""

from pathlib import Path

import pytest

from robot_formation.errors import FormationError
from robot_formation.experiment.scenario import Scenario
from robot_formation.launching import arguments
from robot_formation.launching.arguments import ARGUMENTS, rviz_remappings, scenario_of, split_settings


def scenario(**values: str) -> Scenario:
    return scenario_of({name: argument.default for name, argument in ARGUMENTS.items()} | values)


@pytest.mark.parametrize(
    ("text", "settings"),
    [
        ("", []),
        ("  seed=3   followers=2 ", ["seed=3", "followers=2"]),
        (
            "world.surface_parameters=[file=hills.png, scale_m=0.2] followers=2",
            ["world.surface_parameters=[file=hills.png, scale_m=0.2]", "followers=2"],
        ),
        ("name='my run' seed=3", ["name='my run'", "seed=3"]),
        ('leader={timesteps: 4, followers: ["a b"]} seed=3', ['leader={timesteps: 4, followers: ["a b"]}', "seed=3"]),
        ("name=don't seed=3", ["name=don't", "seed=3"]),
        ("drive.calibration.v=[0.0, 33] seed=3", ["drive.calibration.v=[0.0, 33]", "seed=3"]),
    ],
)
def test_settings_are_split_at_spaces_outside_lists_and_quotes(text: str, settings: list[str]) -> None:
    assert split_settings(text) == settings


@pytest.mark.parametrize("text", ["seed=[3", "seed=3]", "name='my run"])
def test_what_is_not_closed_is_said(text: str) -> None:
    with pytest.raises(FormationError, match="has no partner"):
        split_settings(text)


def test_a_list_with_spaces_arrives_in_the_scenario() -> None:
    settings = "world.surface_parameters=[slope_deg=2, direction_deg=0] followers=2"
    found = scenario(track="one", surface="inclined_plane", set=settings)
    assert found.world.surface_parameters == ("slope_deg=2", "direction_deg=0")
    assert found.setup.followers == 2


def test_a_preset_is_found_by_name_and_the_schedule_has_an_argument() -> None:
    found = scenario(scenario="line_of_five", schedule="wave")
    assert found.setup.name == "line_of_five"
    assert found.setup.schedule == "wave"


@pytest.mark.parametrize(
    ("name", "value", "says"),
    [
        ("scenario", "line_of_six", "no scenario file or preset 'line_of_six'; did you mean 'line_of_"),
        ("schedule", "waves", "schedule:= can't be 'waves'"),
        ("predictor", "foo", "predictor:= can't be 'foo'"),
        ("seed", "x", "seed:="),
        ("real_time_factor", "fast", "real_time_factor:="),
        ("set", "nosuch.x=1", "set: no node 'nosuch'"),
        ("track", "tow", "did you mean 'two'"),
    ],
)
def test_a_complaint_names_the_argument(name: str, value: str, says: str) -> None:
    with pytest.raises(FormationError) as error:
        scenario(**{name: value})
    assert says in str(error.value)
    assert "--set" not in str(error.value)


def test_the_viewers_topics_are_remapped_into_the_namespace() -> None:
    found = dict(rviz_remappings("/site"))
    assert {"/tf", "/tf_static", "/clock"} < set(found)
    assert all(there == f"/site{topic}" for topic, there in found.items())
    assert rviz_remappings("/") == []


@pytest.mark.parametrize("content", [None, "", "Visualization Manager: 3", "{a: 1, a: 2}"])
def test_displays_that_are_missing_or_broken_are_told_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, content: str | None
) -> None:
    file = tmp_path / "formation.rviz"
    monkeypatch.setattr(arguments, "rviz_config", lambda: file)
    if content is not None:
        file.write_text(content)
    with pytest.raises(FormationError, match=r"^\S*formation\.rviz: [^\n]*$"):
        rviz_remappings("/site")
