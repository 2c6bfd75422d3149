"""Our launcher and launch/formation.launch.py start the same nodes with the same parameters."""

import importlib.util
import json
import re
import sys
import types
from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

from robot_formation.errors import FormationError
from robot_formation.experiment import scenario as scenarios
from robot_formation.launching.processes import processes
from robot_formation.paths import share_dir

RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"


class Recorded:
    """Stands in for the launch actions: keeps what it was made with."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        self.arguments, self.options = arguments, options

    def perform(self, context: "Context") -> str:
        return context.arguments[self.arguments[0]]


class Context:
    """Stands in for launch's context."""

    def __init__(
        self, arguments: Mapping[str, str], pushed: str = "", environment: Mapping[str, str] | None = None
    ) -> None:
        self.arguments = arguments
        self.launch_configurations = {"ros_namespace": pushed} if pushed else {}
        self.environment = dict(environment or {})
        self.locals = types.SimpleNamespace()
        self.is_shutdown = False

    def extend_globals(self, values: Mapping[str, Any]) -> None:
        vars(self.locals).update(values)


@pytest.fixture
def launch_file(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The launch file's module, with stand-ins for launch where no ROS install has it."""
    names = {
        "launch": ["LaunchContext", "LaunchDescription"],
        "launch.actions": ["DeclareLaunchArgument", "EmitEvent", "LogInfo", "OpaqueFunction"],
        "launch.events": ["Shutdown", "matches_action"],
        "launch.events.process": ["ShutdownProcess"],
        "launch.substitutions": ["LaunchConfiguration"],
        "launch_ros": [],
        "launch_ros.actions": ["Node"],
    }
    for name, members in names.items():
        module = types.ModuleType(name)
        for member in members:
            setattr(module, member, type(member, (Recorded,), {}))
        monkeypatch.setitem(sys.modules, name, module)
    path = share_dir() / "launch" / "formation.launch.py"
    spec = importlib.util.spec_from_file_location("formation_launch", path)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def context_of(launch_file: ModuleType, options: dict[str, Any] | None = None, **arguments: str) -> Context:
    """What launch hands to the launch file when a user gives these arguments."""
    values = {name: argument.default for name, argument in launch_file.ARGUMENTS.items()} | arguments
    return Context(values, **(options or {}))


def started(launch_file: ModuleType, options: dict[str, Any] | None = None, **arguments: str) -> list[dict[str, Any]]:
    """The options of the Node actions."""
    return [node.options for node in launch_file.nodes(context_of(launch_file, options, **arguments))]


def launched(launch_file: ModuleType, **arguments: str) -> list[tuple[str, str, dict[str, Any]]]:
    """What the launch file starts: executable, namespace and parameters of each node of the run."""
    return [
        (options["executable"], options["namespace"], options["parameters"][0])
        for options in started(launch_file, None, **arguments)
        if options["executable"] != "progress"
    ]


def test_both_start_the_same_nodes(launch_file: ModuleType, tmp_path: Path) -> None:
    bag = tmp_path / "bag"
    scenario = scenarios.override(
        scenarios.load_track("one"), ["seed=3", "predictor.name=literal", "predictor.forgetting=0.9", "followers=2"]
    )
    ours = [(p.executable, p.namespace, p.ros_parameters()) for p in processes(scenario, bag)]
    relative = [(executable, namespace.lstrip("/"), parameters) for executable, namespace, parameters in ours]
    theirs = launched(
        launch_file,
        track="one",
        seed="3",
        predictor="literal",
        set="predictor.forgetting=0.9 followers=2",
        bag=str(bag),
    )
    assert theirs == relative
    assert [(executable, namespace) for executable, namespace, _ in ours] == [
        ("recorder", "/"),
        ("world", "/"),
        ("overhead_tracker", "/"),
        ("drive", "/leader"),
        ("drive", "/follower_1"),
        ("drive", "/follower_2"),
        ("block_detector", "/follower_1"),
        ("block_detector", "/follower_2"),
        ("predictor", "/follower_1"),
        ("predictor", "/follower_2"),
        ("fine_tuner", "/follower_1"),
        ("fine_tuner", "/follower_2"),
        ("leader", "/leader"),
    ]


def test_a_launch_without_bag_has_no_recorder_and_waits_for_none(launch_file: ModuleType) -> None:
    nodes = launched(launch_file)
    assert "recorder" not in {executable for executable, _, _ in nodes}
    assert {parameters["recorder"] for _, _, parameters in nodes} == {""}


def test_a_scenario_file_and_a_surface_are_taken(launch_file: ModuleType, tmp_path: Path) -> None:
    file = tmp_path / "mine.yaml"
    file.write_text("leader: {timesteps: 7}")
    found = launched(launch_file, scenario=str(file), surface="plane")
    nodes = {executable: parameters for executable, _, parameters in found}
    assert nodes["leader"]["timesteps"] == 7
    assert nodes["world"]["surface"] == "plane"


@pytest.fixture
def with_rviz(launch_file: ModuleType, monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine that has rviz2."""
    monkeypatch.setattr(launch_file, "get_package_prefix", lambda name: f"/opt/{name}")


def test_rviz_is_started_beside_the_nodes_and_does_not_end_the_run(launch_file: ModuleType, with_rviz: None) -> None:
    (viewer,) = started(launch_file, rviz="true")[len(started(launch_file)) :]
    assert viewer["package"] == viewer["executable"] == "rviz2"
    assert Path(viewer["arguments"][1]).is_file()
    assert "on_exit" not in viewer
    assert viewer["remappings"] == []
    assert all("on_exit" in options for options in started(launch_file))


def test_rviz_looks_into_the_formations_namespace(launch_file: ModuleType, with_rviz: None) -> None:
    viewer = started(launch_file, {"pushed": "site"}, rviz="true", namespace="a")[-1]
    remappings = dict(viewer["remappings"])
    assert remappings["/surface"] == "/site/a/surface"
    assert remappings["/tf"] == "/site/a/tf"
    assert remappings["/leader/robot_description"] == "/site/a/leader/robot_description"


def test_without_rviz2_nothing_is_started_and_that_is_said(
    launch_file: ModuleType, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    with pytest.raises(FormationError, match="rviz:=true needs the package rviz2, which is not installed"):
        started(launch_file, rviz="true")


def test_a_bag_that_exists_is_refused_before_anything_is_started(launch_file: ModuleType, tmp_path: Path) -> None:
    with pytest.raises(FormationError, match="exists already"):
        started(launch_file, bag=str(tmp_path))


def test_every_launch_argument_is_declared_with_its_choices(launch_file: ModuleType) -> None:
    (declared,) = launch_file.generate_launch_description().arguments
    *arguments, nodes = declared
    assert [action.arguments[0] for action in arguments] == list(launch_file.ARGUMENTS)
    choices = {action.arguments[0]: action.options["choices"] for action in arguments}
    assert "maybe" not in choices["images"]
    assert choices["track"] is None
    assert type(nodes).__name__ == "OpaqueFunction"


@pytest.mark.parametrize(
    ("exported", "argument", "expected"),
    [
        ({}, "", {RANGE: "LOCALHOST"}),
        ({RANGE: "SUBNET"}, "", {}),  # inherited as it is
        ({RANGE: "SUBNET"}, "OFF", {RANGE: "OFF"}),
    ],
)
def test_discovery_stays_here_unless_told_otherwise_and_only_the_nodes_are_told(
    launch_file: ModuleType, exported: dict[str, str], argument: str, expected: dict[str, str]
) -> None:
    nodes = started(launch_file, {"environment": exported}, discovery_range=argument)
    assert [options["additional_env"] for options in nodes] == [expected] * len(nodes)


def test_names_are_relative_so_that_a_pushed_namespace_comes_first(launch_file: ModuleType, tmp_path: Path) -> None:
    bag = str(tmp_path / "bag")
    assert {options["namespace"] for options in started(launch_file, bag=bag)} == {"", "leader", "follower_1"}
    namespaces = {options["namespace"] for options in started(launch_file, bag=bag, namespace="site_a")}
    assert namespaces == {"site_a", "site_a/leader", "site_a/follower_1"}


class Ended:
    """Stands in for launch's event of a process's end."""

    def __init__(self, returncode: int) -> None:
        self.returncode = returncode


def ends(launch_file: ModuleType, context: Context, nodes: list[Any], codes: dict[str, int]) -> list[Any]:
    """Let processes end in this order, all others well; return the names of the actions that follow, with arguments."""
    handlers = {options["executable"]: options["on_exit"] for options in nodes}
    order = [*codes, *(name for name in handlers if name not in codes)]
    actions = [action for name in order for action in handlers[name](Ended(codes.get(name, 0)), context)]
    return [(type(action).__name__, action.options) for action in actions]


@pytest.mark.parametrize(
    ("codes", "last", "says"),
    [
        ({"leader": 0}, "EmitEvent", "outcome: done"),
        ({"fine_tuner": 3}, "OpaqueFunction", "outcome: lost (follower_1/fine_tuner ended with exit code 3)"),
        ({"world": -9}, "OpaqueFunction", "outcome: incomplete (world was killed by SIGKILL)"),
    ],
)
def test_the_first_end_ends_the_run_and_the_last_one_says_how_it_went(
    launch_file: ModuleType, codes: dict[str, int], last: str, says: str
) -> None:
    context = context_of(launch_file)
    nodes = [node.options for node in launch_file.nodes(context)]
    nodes = [options for options in nodes if options["namespace"] != "leader" or options["executable"] == "leader"]
    context.locals.robot_formation_runs[0].processes = len(nodes)
    actions = ends(launch_file, context, nodes, codes)
    events = [type(options["event"]).__name__ for name, options in actions if name == "EmitEvent"]
    assert events[0] == "ShutdownProcess"
    assert actions[-1][0] == last
    told = [options["msg"] for name, options in actions if name == "LogInfo"]
    told += [text for name, options in actions if name == "OpaqueFunction" for text in options["args"]]
    assert told == [says]


def test_of_two_runs_the_first_leaves_the_other_alone_and_a_failure_is_told_at_the_end(launch_file: ModuleType) -> None:
    context = context_of(launch_file)
    for _ in range(2):
        launch_file.nodes(context)
    first, second = context.locals.robot_formation_runs
    for run, name, code in ((first, "fine_tuner", 3), (second, "leader", 0)):
        run.processes = 1
        run.ended(name, name, code, stopping=False)
        actions = launch_file.conclusion(run, [first, second])
        second.processes = 1 if run is second else 2
    assert [type(action).__name__ for action in actions] == ["LogInfo", "OpaqueFunction"]
    assert "outcome: lost" in actions[1].options["args"][0]
    with pytest.raises(FormationError, match="outcome: lost"):
        launch_file.fail(context, *actions[1].options["args"])


def test_parameters_survive_the_way_through_a_ros_parameter_file(tmp_path: Path) -> None:
    import yaml

    for process in processes(scenarios.load_track("two"), Path("bag")):
        text = yaml.safe_dump({"/**": {"ros__parameters": process.ros_parameters()}})
        assert yaml.safe_load(text)["/**"]["ros__parameters"] == process.ros_parameters()


def test_without_the_overhead_camera_its_tracker_is_not_started() -> None:
    scenario = scenarios.override(scenarios.load_track("two"), ["world.overhead.enabled=false"])
    assert "overhead_tracker" not in {process.executable for process in processes(scenario, None)}


def test_a_formation_in_a_namespace_lies_there_as_a_whole(tmp_path: Path) -> None:
    scenario = scenarios.load_track("two")
    placed = [process.name for process in processes(scenario, tmp_path / "bag", namespace="/site_a")]
    assert placed == [f"/site_a{process.name}" for process in processes(scenario, tmp_path / "bag")]
    assert "/site_a/follower_1/drive" in placed
    assert "/site_a/recorder" in placed


def test_nodes_that_are_left_out_are_not_started_and_the_others_wait_for_them(
    launch_file: ModuleType, tmp_path: Path
) -> None:
    options = {"without": "block_detector, follower_1/predictor", "stand_in_timeout": "20", "set": "followers=2"}
    nodes = started(launch_file, None, track="one", bag=str(tmp_path / "bag"), **options)
    names = [f"{node['namespace']}/{node['executable']}".strip("/") for node in nodes]
    assert "follower_2/predictor" in names
    left_out = ["follower_1/block_detector", "follower_2/block_detector", "follower_1/predictor"]
    assert not set(names) & set(left_out)
    parameters = {name: node["parameters"][0] for name, node in zip(names, nodes, strict=True)}
    waiting = {name: found.get("wait_for_nodes") for name, found in parameters.items() if name not in names[-1:]}
    assert waiting == {name: left_out for name in waiting if name != "recorder"} | {"recorder": None}
    assert (parameters["progress"]["stand_ins"], parameters["progress"]["stand_in_timeout_s"]) == (left_out, 20.0)
    (said,) = [text for text in parameters["recorder"]["metadata"] if text.startswith("stand_ins=")]
    assert json.loads(said.partition("=")[2]) == left_out


@pytest.mark.parametrize(
    ("arguments", "says"),
    [
        ({"without": "block_detektor"}, "without:=: this run has no node 'block_detektor' to leave out; did you mean"),
        ({"without": "leader"}, "without:= can't leave out the leader"),
        ({"stand_in_timeout": "soon"}, "stand_in_timeout:= can't be 'soon'"),
        ({"stand_in_timeout": "nan"}, "stand_in_timeout:= can't be 'nan'"),
    ],
)
def test_what_cannot_be_left_out_is_told_before_anything_is_started(
    launch_file: ModuleType, arguments: dict[str, str], says: str
) -> None:
    with pytest.raises(FormationError, match=re.escape(says)):
        started(launch_file, None, **arguments)
