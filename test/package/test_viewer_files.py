"""The files for viewers are valid and name topics that a run has."""

import json
import re
from collections.abc import Iterator
from typing import Any

import pytest
import yaml

from robot_formation import names
from robot_formation.components.base import Place
from robot_formation.experiment.scenario import load_track
from robot_formation.names import Topic, absolute
from robot_formation.paths import config_dir

RVIZ = yaml.safe_load((config_dir() / "formation.rviz").read_text())
LAYOUT = json.loads((config_dir() / "foxglove_layout.json").read_text())
RVIZ_TYPES = {
    "Marker": "visualization_msgs/msg/Marker",
    "Path": "nav_msgs/msg/Path",
    "Pose": "geometry_msgs/msg/PoseStamped",
    "Image": "sensor_msgs/msg/Image",
    "RobotModel": "std_msgs/msg/String",
}


@pytest.fixture(scope="module")
def topics() -> dict[str, Topic]:
    """Every topic of a run of track two, absolute, with its QoS and type."""
    scenario = load_track("two")
    found = {absolute("", topic.name): topic for topic in (names.TF, names.TF_STATIC)}
    for kind, robot in scenario.hosts():
        parameters = scenario.of_robot(kind, robot)
        namespace = f"/{robot}" if robot else ""
        for topic in kind.component_class()(parameters, Place(robot)).outputs():
            found[absolute(namespace, topic.name)] = topic
    return found


def displays() -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = RVIZ["Visualization Manager"]["Displays"]
    return found


def values_of(tree: Any, keys: set[str]) -> Iterator[Any]:
    """Every value under one of the keys, at any depth."""
    if isinstance(tree, dict):
        for key, value in tree.items():
            if key in keys:
                yield value
            yield from values_of(value, keys)
    elif isinstance(tree, list):
        for item in tree:
            yield from values_of(item, keys)


def test_rviz_shows_topics_of_the_right_type_with_a_qos_that_matches(topics: dict[str, Topic]) -> None:
    shown = 0
    for display in displays():
        kind = display["Class"].removeprefix("rviz_default_plugins/")
        asked = display.get("Topic") or display.get("Description Topic")
        if kind == "TF":
            continue
        assert asked is not None
        topic = topics[asked["Value"]]
        assert topic.type == RVIZ_TYPES[kind]
        # What was said before is only told to a listener that asks for it.
        if topic.qos in (names.LATCHED, names.GROWING):
            assert asked["Durability Policy"] == "Transient Local"
        shown += 1
    assert shown == len(displays()) - 1


def test_rviz_puts_each_robots_name_before_its_links() -> None:
    models = {display["TF Prefix"]: display for display in displays() if display["Class"].endswith("RobotModel")}
    assert set(models) == {"leader", "follower_1"}
    for robot, display in models.items():
        assert display["Description Topic"]["Value"] == f"/{names.robot_description(robot).name}"
    assert RVIZ["Visualization Manager"]["Global Options"]["Fixed Frame"] == names.WORLD_FRAME


def test_the_layout_names_topics_that_exist(topics: dict[str, Topic]) -> None:
    found = [*values_of(LAYOUT, {"topic", "imageTopic", "calibrationTopic", "topicPath"})]
    for listed in values_of(LAYOUT, {"topics"}):
        found += listed
    for paths in values_of(LAYOUT, {"paths"}):
        found += [path["value"].partition(".")[0] for path in paths]
    assert len(found) > 15
    assert [name for name in found if name not in topics] == []


def test_the_layout_places_every_panel_once() -> None:
    panels = re.findall(r'"(\w+!\w+)"', json.dumps(LAYOUT["layout"]))
    assert sorted(panels) == sorted(LAYOUT["configById"])


def test_the_layouts_robots_have_their_frame_prefix() -> None:
    layers = [layer for layers in values_of(LAYOUT, {"layers"}) for layer in layers.values()]
    assert {layer["framePrefix"]: layer["topic"] for layer in layers} == {
        "leader/": "/leader/robot_description",
        "follower_1/": "/follower_1/robot_description",
    }
