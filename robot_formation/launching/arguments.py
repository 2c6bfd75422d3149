"""The arguments of launch/formation.launch.py, and what they mean; without launch."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from robot_formation.errors import FormationError, shown
from robot_formation.experiment import scenario as scenarios
from robot_formation.experiment.scenario import Scenario
from robot_formation.experiment.stand_ins import LEADER_NODE, LONGEST_S, stand_ins_of
from robot_formation.network.loopback import PROFILES, RANGE, use_loopback
from robot_formation.paths import config_dir
from robot_formation.schedule.schedules import Schedule
from robot_formation.system.yaml_files import Yaml, read_yaml
from robot_formation.world.parameters import CameraMode

_SCHEDULES = tuple(schedule.value for schedule in Schedule)
_CAMERA_MODES = tuple(mode.value for mode in CameraMode)
_SWITCH = ("true", "false", "True", "False", "1", "0")
_OPENING, _CLOSING = "[{", "]}"
_BEFORE_QUOTE = "=[{,: "


@dataclass(frozen=True)
class Argument:
    """A launch argument: default, description, and its values where only some are allowed."""

    default: str
    description: str
    choices: tuple[str, ...] | None = None


ARGUMENTS = {
    "track": Argument("two", "preset track: see 'formation list tracks'"),
    "scenario": Argument("", "scenario file or name, instead of a track: see 'formation list scenarios'"),
    "path": Argument("", "the leader's path: see 'formation list paths'; empty: the scenario's"),
    "surface": Argument("", "surface: see 'formation list surfaces'; empty: the scenario's"),
    "predictor": Argument("", "predictor: see 'formation list predictors'; empty: the scenario's"),
    "schedule": Argument(
        "", f"{', '.join(_SCHEDULES[:-1])} or {_SCHEDULES[-1]}; empty: the scenario's", ("", *_SCHEDULES)
    ),
    "seed": Argument("", "seed of every random stream; empty: the scenario's"),
    "camera": Argument("", f"{' or '.join(_CAMERA_MODES)}; empty: the scenario's", ("", *_CAMERA_MODES)),
    "real_time_factor": Argument("", "0: as fast as possible, 1: real time; empty: the scenario's"),
    "set": Argument("", "further settings, separated by spaces, like 'predictor.forgetting=0.95 followers=2'"),
    "namespace": Argument("", "namespace of the formation, below the one that was pushed; empty: none of its own"),
    "without": Argument(
        "",
        "nodes that are not started but waited for by name, separated by spaces: block_detector (that of every "
        "follower), follower_2/block_detector, ...",
    ),
    "stand_in_timeout": Argument("300", "how long they may take to appear, in seconds"),
    "bag": Argument("", "folder of the bag, which must not exist; empty: nothing is recorded"),
    "images": Argument("false", "record pictures too", _SWITCH),
    "rviz": Argument("false", "show the run in RViz, which must be installed; closing it doesn't end the run", _SWITCH),
    "discovery_range": Argument(
        "",
        f"who may find the nodes; empty: what {RANGE} says, else LOCALHOST",
        ("", "LOCALHOST", "SUBNET", "OFF", "SYSTEM_DEFAULT"),
    ),
}


def scenario_of(values: Mapping[str, str]) -> Scenario:
    """Return the scenario that the arguments describe.

    Raises:
        FormationError: naming the argument that is wrong.
    """
    file = values["scenario"]
    scenario = scenarios.load(Path(file)) if file else scenarios.load_track(values["track"])
    if values["surface"]:
        scenario = scenarios.with_surface(scenario, values["surface"])
    for name, key in (
        ("path", "leader.path"),
        ("predictor", "predictor.name"),
        ("schedule", "schedule"),
        ("seed", "seed"),
        ("camera", "world.camera.mode"),
        ("real_time_factor", "world.real_time_factor"),
    ):
        if values[name]:
            scenario = scenarios.with_option(scenario, key, values[name], f"{name}:=")
    scenario = scenarios.override(scenario, split_settings(values["set"]), source="set")
    scenario.check()
    return scenario


def left_out(values: Mapping[str, str], scenario: Scenario) -> tuple[tuple[str, ...], float]:
    """Return the nodes that somebody else starts, and how long to wait for them, in seconds.

    Raises:
        FormationError: naming the argument that is wrong.
    """
    text = values["stand_in_timeout"]
    try:
        timeout_s = float(text)
    except ValueError:
        timeout_s = 0.0
    if not 0.0 < timeout_s <= LONGEST_S:
        raise FormationError(f"stand_in_timeout:= can't be {shown(text)}; give seconds, above 0, {LONGEST_S:g} at most")
    found = stand_ins_of(scenario, values["without"].replace(",", " ").split(), "without:=")
    if LEADER_NODE in found:
        raise FormationError("without:= can't leave out the leader, whose end is the run's; 'formation run' can")
    return found, timeout_s


def split_settings(text: str) -> list[str]:
    """Split settings at spaces, but not inside brackets or quotes: 'world.robots=[a, b] seed=3' holds two.

    Raises:
        FormationError: a bracket or a quote is not closed.
    """
    found, begin, depth, quote = [], 0, 0, ""
    for place, sign in enumerate(text):
        if quote:
            quote = "" if sign == quote else quote
        elif sign in "'\"" and (place == 0 or text[place - 1] in _BEFORE_QUOTE):
            quote = sign
        elif sign in _OPENING:
            depth += 1
        elif sign in _CLOSING:
            depth -= 1
        elif sign.isspace() and depth == 0:
            found.append(text[begin:place])
            begin = place + 1
    if depth or quote:
        raise FormationError(f"set: {text}: a {'quote' if quote else 'bracket'} has no partner")
    return [setting for setting in [*found, text[begin:]] if setting]


def is_true(text: str) -> bool:
    """Read a switch as other launch files do."""
    return text.lower() in ("true", "1")


def discovery(argument: str, environment: Mapping[str, str]) -> dict[str, str]:
    """Return which variables the nodes need so that those find them who should: the argument, else what is exported."""
    wanted = argument or ("" if environment.get(RANGE) else "LOCALHOST")
    return {RANGE: wanted} if wanted else {}


def viewer_environment(given: Mapping[str, str], exported: Mapping[str, str]) -> dict[str, str]:
    """Return which variables a viewer needs; our nodes bind themselves to the loopback interface, it can't.

    Args:
        given: what the nodes are given.
        exported: what is inherited.
    """
    whole = {**exported, **given}
    use_loopback(whole)
    return {name: whole[name] for name in (RANGE, *PROFILES) if name in whole}


def rviz_config() -> Path:
    """Return the file of the viewer's displays."""
    return config_dir() / "formation.rviz"


def rviz_remappings(namespace: str) -> list[tuple[str, str]]:
    """List what the viewer has to remap for a formation in a namespace ('' or absolute).

    Raises:
        FormationError: the file of the displays can't be read or holds none.
    """
    if not namespace.strip("/"):
        return []
    file, remedy = rviz_config(), "install the package again"
    try:
        displays = read_yaml(file, refuse=FormationError, remedy=remedy)["Visualization Manager"]["Displays"]
    except (KeyError, TypeError):
        raise FormationError(f"{file}: holds no displays of RViz; {remedy}") from None
    topics = dict.fromkeys(["/tf", "/tf_static", "/clock", *_topics(displays)])
    return [(topic, f"{namespace.rstrip('/')}{topic}") for topic in topics]


def _topics(displays: Yaml) -> Iterator[str]:
    """Find the topics in RViz's displays: the values of 'Topic' and 'Description Topic'."""
    for display in displays:
        for entry in ("Topic", "Description Topic"):
            topic = display.get(entry)
            if isinstance(topic, dict) and topic.get("Value"):
                yield topic["Value"]
