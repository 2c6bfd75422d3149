"""Parameter names of the nodes: none is a value and a group at once, so that a dump can hold them all."""

from collections.abc import Sequence

import pytest

from robot_formation.components.catalogue import KINDS
from robot_formation.nodes.host.ros_parameters import HostParameters
from robot_formation.nodes.player.player_node import PlayerParameters
from robot_formation.nodes.progress.progress_node import ProgressParameters
from robot_formation.nodes.recorder.recorder_node import RecorderParameters
from robot_formation.nodes.viewer.viewer_node import ViewerParameters
from robot_formation.parameters import specs

OF_RCLPY = ("use_sim_time", "start_type_description_service", "qos_overrides./topic.subscription.reliability")
NODES: dict[str, tuple[type, ...]] = {
    **{kind: (entry.parameter_class(), HostParameters) for kind, entry in KINDS.items()},
    "recorder": (RecorderParameters, HostParameters),
    "player": (PlayerParameters,),
    "progress": (ProgressParameters,),
    "viewer": (ViewerParameters,),
}


def clashes(names: Sequence[str]) -> list[str]:
    return sorted(name for name in names if any(other.startswith(f"{name}.") for other in names))


@pytest.mark.parametrize("node", NODES)
def test_no_name_is_a_value_and_a_group_at_once(node: str) -> None:
    names = [*OF_RCLPY, *(name for cls in NODES[node] for name in specs(cls))]
    assert clashes(names) == []
    assert len(names) == len(set(names))


def test_a_clash_would_be_seen() -> None:
    assert clashes(["formation", "formation.gain", "name", "name_of"]) == ["formation"]


def test_the_predictors_group_has_kept_its_name() -> None:
    assert any(name.startswith("formation.") for name in specs(NODES["predictor"][0]))
