"""A real block_detector node: bad pictures, parameters set while it runs, and what its diagnostics say."""

import array
from pathlib import Path
from typing import Any

import pytest
from rcl_interfaces.srv import SetParameters
from rclpy.parameter import Parameter

from graph_lab import Lab, values_of
from robot_formation import conversions, names
from robot_formation.vision.pixy2.signatures import save_signatures
from vision_helpers import GROUPS, RED, canvas

pytestmark = [pytest.mark.graph, pytest.mark.xdist_group("block_detector")]
SQUARE = canvas(((134, 60, 48, 48), RED))


def image(number: int, **values: Any) -> Any:
    message = conversions.image(SQUARE, "camera", number * 33_333_333)
    for name, value in values.items():
        setattr(message, name, value)
    return message


def set_parameter(lab: Lab, **values: Any) -> Any:
    client = lab.node.create_client(SetParameters, "/follower_1/block_detector/set_parameters")
    lab.until(client.service_is_ready)
    request = SetParameters.Request(parameters=[Parameter(n, value=v).to_parameter_msg() for n, v in values.items()])
    future = client.call_async(request)
    lab.until(future.done)
    (result,) = future.result().results
    return result


def test_a_node_drops_bad_pictures_takes_parameters_and_reports_rate_and_time(lab: Lab, tmp_path: Path) -> None:
    save_signatures(tmp_path / "taught.yaml", GROUPS["G1"])
    parameters = ("block_filtering:=0", f"signatures_file:={tmp_path / 'taught.yaml'}", "wait_for_listeners_s:=0.0")
    lab.start("block_detector", *(word for p in parameters for word in ("-p", p)), namespace="/follower_1")
    blocks = lab.collect(names.BLOCKS, namespace="/follower_1")
    health = lab.collect(names.DIAGNOSTICS)
    pictures = lab.publisher(names.camera_image(), namespace="/follower_1")
    pictures.publish(image(0, encoding="mono8"))
    pictures.publish(image(0, data=array.array("B", bytes(5))))
    pictures.publish(image(0, height=2**32 - 1, step=2**32 - 1))
    for number in range(1, 4):
        pictures.publish(image(number))
    lab.until(lambda: len(blocks) == 3)
    assert [len(conversions.read_blocks(message)) for message in blocks] == [0, 1, 1]

    refused = set_parameter(lab, min_block_area=3)
    assert not refused.successful
    assert "min_block_area" in refused.reason
    assert "missing.yaml" in set_parameter(lab, signatures_file=str(tmp_path / "missing.yaml")).reason
    assert "used while the node starts" in set_parameter(lab, wait_for_listeners_s=1.0).reason
    assert set_parameter(lab, min_block_area=2500).successful
    pictures.publish(image(4))
    lab.until(lambda: len(blocks) == 4)
    assert conversions.read_blocks(blocks[3]) == []

    def latest() -> dict[str, str]:
        return {value.key: value.value for value in values_of(health, "block_detector")}

    lab.until(lambda: latest().get("frames") == "4")
    assert latest()["dropped"] == "3"
    assert latest()["frame_rate_hz"] == "30.0"
    assert 0.0 < float(latest()["processing_mean_ms"]) <= float(latest()["processing_worst_ms"])
