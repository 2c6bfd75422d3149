"""Message definitions: those that are kept in a file are rosbags', and what is read from their texts."""

import importlib.util

import pytest

from repository import ROOT
from robot_formation.bag.definitions import DEFINITIONS_FILE, Definition, definition, jazzy_typestore, looked_up
from robot_formation.bag.errors import BagError

TIMES = ("std_msgs/msg/Header", "builtin_interfaces/msg/Time")


def test_the_file_holds_what_rosbags_says_of_the_projects_types() -> None:
    spec = importlib.util.spec_from_file_location("maker", ROOT / "bench" / "make_message_definitions.py")
    assert spec is not None
    assert spec.loader is not None
    maker = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(maker)
    told = "write it anew: python bench/make_message_definitions.py"
    assert DEFINITIONS_FILE.read_text(encoding="utf-8") == maker.as_json(), told
    assert "nav_msgs/msg/Odometry" in maker.types()
    for type_name in maker.types():
        assert definition(type_name) == looked_up(type_name)


def test_a_type_begins_with_a_time_if_its_first_field_is_one() -> None:
    store = jazzy_typestore()
    found = {name: looked_up(name).begins_with_time for name in store.fielddefs if "/msg/" in name}
    expected = {name: bool(fields) and fields[0][1][1] in TIMES for name, (_, fields) in store.fielddefs.items()}
    assert found == {name: expected[name] for name in found}
    assert found["sensor_msgs/msg/JoyFeedback"] is False  # begins with constants
    assert found["nav_msgs/msg/Odometry"]


@pytest.mark.parametrize(
    ("text", "time"),
    [
        ("string<=10 name\nstd_msgs/Header header", False),
        ("float64[<=3] x\nbuiltin_interfaces/Time stamp", False),
        ("string NAME=a b\nuint8 MOST = 3\n\nbuiltin_interfaces/Time stamp", True),
        ("int32 x 5\nstd_msgs/Header header", False),
        ("", False),
    ],
)
def test_a_bounded_field_is_a_field_and_a_constant_is_none(text: str, time: bool) -> None:
    below = "\n" + "=" * 80 + "\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp"
    assert Definition("package/msg/Name", "ros2msg", text + below, "").begins_with_time is time


def test_a_type_that_nobody_knows_is_refused() -> None:
    with pytest.raises(BagError, match="no message type 'nav_msgs/msg/Odometri'"):
        definition("nav_msgs/msg/Odometri")
