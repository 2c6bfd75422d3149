"""The block detector on messages: every good picture is answered in its frame and with its stamp."""

import array
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from component_helpers import Wire, wired
from robot_formation import conversions, names
from robot_formation.components.catalogue import KINDS
from robot_formation.parameters import ParameterError, from_mapping
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.signatures import SignatureError, save_signatures
from tag_helpers import needs_tags
from vision_helpers import GREEN, GROUPS, RED, canvas

CAMERA, IMAGE = "follower_1/camera_optical_frame", "camera/image_raw"
SQUARE = canvas(((134, 60, 48, 48), RED))
EMPTY = canvas()


@pytest.fixture(scope="module")
def signatures(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("signatures") / "taught.yaml"
    save_signatures(path, GROUPS["G1"])
    return str(path)


@pytest.fixture
def wire(signatures: str) -> Wire:
    """A detector without filtering: a block is reported from its second picture on."""
    return wired("block_detector", "follower_1", signatures_file=signatures, block_filtering=0)


def image(pixels: NDArray[np.uint8], number: int) -> Any:
    """The frame of this number at 30 frames per second."""
    return conversions.image(pixels, CAMERA, number * 33_333_333)


def counted(wire: Wire) -> tuple[str, str]:
    """Pictures processed and dropped, as the diagnostics show them."""
    values = wire.component.health().values
    return values["frames"], values["dropped"]


def blocks_in(sent: Sequence[tuple[str, Any]]) -> list[Block]:
    ((topic, message),) = sent
    assert topic == "blocks"
    return conversions.read_blocks(message)


@needs_tags
def test_pictures_of_one_time_taken_by_two_sensors_have_no_rate(signatures: str, wire: Wire) -> None:
    parameters = KINDS["block_detector"].parameter_class()
    wire.give(IMAGE, image(SQUARE, 2))
    for sensor in ("tags", "colours"):
        wire.component.set_parameters(
            from_mapping(parameters, {"sensor": sensor, "signatures_file": signatures}, where="test")
        )
        wire.give(IMAGE, image(SQUARE, 2))
    assert counted(wire) == ("3", "0")
    assert wire.component.details()["frame_rate_hz"] == ""


def test_a_picture_is_answered_with_its_blocks_its_stamp_and_its_frame(wire: Wire) -> None:
    assert blocks_in(wire.give(IMAGE, image(SQUARE, 2))) == []
    ((_, message),) = sent = wire.give(IMAGE, image(SQUARE, 3))
    (found,) = blocks_in(sent)
    assert found.signature == 1
    assert (found.x, found.y, found.width, found.height) == pytest.approx((158, 84, 48, 48), abs=4)
    assert conversions.stamp_of(message) == 3 * 33_333_333
    assert message.header.frame_id == CAMERA
    assert wire.component.stamp_ns == 3 * 33_333_333


def test_a_picture_without_blocks_is_answered_too(wire: Wire) -> None:
    ((_, message),) = sent = wire.give(IMAGE, image(EMPTY, 1))
    assert blocks_in(sent) == []
    assert conversions.stamp_of(message) == 33_333_333


def test_blocks_are_tracked_from_picture_to_picture(wire: Wire) -> None:
    _, first, second = (blocks_in(wire.give(IMAGE, image(SQUARE, n))) for n in (1, 2, 3))
    assert (first[0].index, first[0].age + 1) == (second[0].index, second[0].age)


def test_block_filtering_of_the_paper_shows_a_block_in_its_21st_picture(signatures: str) -> None:
    wire = wired("block_detector", "follower_1", signatures_file=signatures, block_filtering=40)
    seen = [bool(blocks_in(wire.give(IMAGE, image(SQUARE, n)))) for n in range(22)]
    assert seen == [False] * 20 + [True] * 2


def changed(**values: Any) -> Any:
    message = image(SQUARE, 1)
    for name, value in values.items():
        setattr(message, name, value)
    return message


WHOLE = array.array("B", SQUARE.tobytes())
BAD = {
    "cut off": changed(data=WHOLE[:-1]),
    "too long": changed(data=WHOLE + WHOLE[:3]),
    "empty": changed(data=array.array("B")),
    "no rows": changed(height=0),
    "no columns": changed(width=0),
    "nothing at all": changed(width=0, height=0, step=0, data=array.array("B")),
    "rows shorter than their pixels": changed(step=947),
    "larger than its data": changed(width=640, height=480, step=1920),
    "more rows than 32 bits can count bytes of": changed(height=2**32 - 1, step=2**32 - 1),
    "0 bytes in 32 bits": changed(height=2**16, step=2**16, data=array.array("B")),
    "grey": changed(encoding="mono8"),
    "with alpha": changed(encoding="rgba8"),
    "16 bits": changed(encoding="rgb16"),
    "Bayer": changed(encoding="bayer_bggr8"),
    "no encoding": changed(encoding=""),
    "strange encoding": changed(encoding="\u20ac" * 1000),
}


@pytest.mark.parametrize("bad", BAD.values(), ids=BAD)
def test_a_bad_picture_is_dropped_counted_and_warned_of(wire: Wire, bad: Any) -> None:
    assert wire.give(IMAGE, bad) == []
    assert len(wire.warnings) == 1
    assert "\n" not in wire.warnings[0]
    assert len(wire.warnings[0]) < 200
    assert counted(wire) == ("0", "1")
    assert wire.component.stamp_ns == 0
    answers = [blocks_in(wire.give(IMAGE, image(SQUARE, n))) for n in (1, 2)]
    assert [len(found) for found in answers] == [0, 1]


@pytest.mark.parametrize("number", [5, 4, 0])
def test_a_picture_that_is_not_later_than_the_one_before_is_dropped(wire: Wire, number: int) -> None:
    wire.give(IMAGE, image(SQUARE, 5))
    assert wire.give(IMAGE, image(SQUARE, number)) == []
    assert len(wire.warnings) == 1
    assert counted(wire) == ("1", "1")
    (found,) = blocks_in(wire.give(IMAGE, image(SQUARE, 6)))
    assert found.age == 0  # as if it had never come


def test_the_other_order_of_colours_gives_the_same_blocks(wire: Wire, signatures: str) -> None:
    swapped = image(np.ascontiguousarray(SQUARE[:, :, ::-1]), 1)
    swapped.encoding = "bgr8"
    other = wired("block_detector", "follower_1", signatures_file=signatures, block_filtering=0)
    assert blocks_in(wire.give(IMAGE, image(SQUARE, 1))) == blocks_in(other.give(IMAGE, swapped)) == []
    swapped.header = image(SQUARE, 2).header
    found = blocks_in(wire.give(IMAGE, image(SQUARE, 2)))
    assert len(found) == 1
    assert blocks_in(other.give(IMAGE, swapped)) == found


def test_a_refused_encoding_is_named_with_what_to_send_instead(wire: Wire) -> None:
    wire.give(IMAGE, BAD["grey"])
    health = wire.component.health()
    assert health.level == 1
    assert health.text == "image encoding 'mono8' has no colour to find blocks by; send rgb8 or bgr8"


@pytest.mark.parametrize("padding", [1, 4, 76])
def test_padded_rows_give_the_same_blocks(wire: Wire, padding: int) -> None:
    rows = np.full((208, 948 + padding), 196, np.uint8)  # the padding looks like the taught red
    rows[:, :948] = SQUARE.reshape(208, 948)
    for number in (1, 2):
        message = image(SQUARE, number)
        message.step = 948 + padding
        message.data = array.array("B", rows.tobytes())
        found = blocks_in(wire.give(IMAGE, message))
    assert (found[0].x, found[0].y, found[0].width, found[0].height) == pytest.approx((158, 84, 48, 48), abs=4)
    assert len(found) == 1
    assert wire.warnings == []


@pytest.mark.parametrize("shape", [(1, 1), (1, 5000), (5000, 1), (2, 3), (1040, 1580)])
def test_pictures_of_any_size_are_answered(wire: Wire, shape: tuple[int, int]) -> None:
    assert blocks_in(wire.give(IMAGE, image(np.zeros((*shape, 3), np.uint8), 1))) == []
    assert counted(wire) == ("1", "0")


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8"])
def test_larger_pictures_are_scaled_with_one_warning(wire: Wire, encoding: str) -> None:
    large = np.repeat(np.repeat(SQUARE, 2, axis=0), 2, axis=1)
    for number in (1, 2):
        message = image(np.ascontiguousarray(large[:, :, ::-1]) if encoding == "bgr8" else large, number)
        message.encoding = encoding
        found = blocks_in(wire.give(IMAGE, message))
    assert (found[0].x, found[0].y, found[0].width, found[0].height) == pytest.approx((158, 84, 48, 48), abs=4)
    assert wire.warnings == ["pictures of 632 x 416 are scaled to 316 x 208"]


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8"])
def test_the_annotated_picture_is_made_only_while_somebody_listens(wire: Wire, encoding: str) -> None:
    def show(number: int) -> list[tuple[str, Any]]:
        message = image(SQUARE if encoding == "rgb8" else np.ascontiguousarray(SQUARE[:, :, ::-1]), number)
        message.encoding = encoding
        return wire.give(IMAGE, message)

    assert len(show(1)) == 1
    wire.component.listened_to(names.BLOCKS_IMAGE, 1)
    (blocks, (topic, message)) = show(2)
    assert topic == "blocks/image"
    assert message.header == blocks[1].header
    drawn = conversions.read_image(message)
    (found,) = conversions.read_blocks(blocks[1])
    changed = (drawn != SQUARE).any(axis=2)
    assert changed[found.y - found.height // 2, found.x]
    assert not changed[found.y, found.x]
    wire.component.listened_to(names.BLOCKS_IMAGE, 0)
    assert len(show(3)) == 1


def test_listeners_of_the_blocks_do_not_ask_for_the_picture(wire: Wire) -> None:
    wire.component.listened_to(names.BLOCKS, 1)
    assert len(wire.give(IMAGE, image(SQUARE, 1))) == 1


def test_blocks_of_every_taught_signature_are_reported(wire: Wire) -> None:
    pair = canvas(((60, 60, 40, 40), RED), ((200, 60, 50, 50), GREEN))
    wire.give(IMAGE, image(pair, 1))
    found = blocks_in(wire.give(IMAGE, image(pair, 2)))
    assert [block.signature for block in found] == [2, 1]  # the larger first
    assert all(isinstance(block, Block) for block in found)


def test_a_missing_signatures_file_is_said_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(SignatureError, match=r"missing\.yaml") as caught:
        wired("block_detector", "follower_1", signatures_file=str(tmp_path / "missing.yaml"))
    assert "\n" not in str(caught.value)


def test_the_frame_rate_is_that_of_the_stamps_whatever_the_pauses_between_bursts(wire: Wire) -> None:
    assert wire.component.details()["frame_rate_hz"] == ""
    for number in (0, 1, 2, 3, 100, 101, 102, 103):
        wire.give(IMAGE, image(EMPTY, number))
    assert wire.component.details()["frame_rate_hz"] == "30.0"


def test_the_processing_time_is_measured_by_the_hosts_clock(wire: Wire) -> None:
    times = iter([10.0, 10.002, 20.0, 20.004, 30.0])
    wire.component.wall_clock = lambda: next(times)
    for message in (image(EMPTY, 1), image(EMPTY, 2), BAD["cut off"]):
        wire.give(IMAGE, message)
    details = wire.component.details()
    assert (details["processing_mean_ms"], details["processing_worst_ms"]) == ("3.000", "4.000")


def test_without_a_clock_there_is_no_processing_time(wire: Wire) -> None:
    wire.give(IMAGE, image(EMPTY, 1))
    assert wire.component.details()["processing_mean_ms"] == wire.component.details()["processing_worst_ms"] == ""


def changed_parameters(wire: Wire, signatures: str, **values: Any) -> None:
    """Set parameters of a running detector as its host does."""
    kind = KINDS["block_detector"].parameter_class()
    values = {"signatures_file": signatures, "block_filtering": 0, **values}
    wire.component.set_parameters(from_mapping(kind, values, where="block_detector"))


def test_changed_parameters_count_from_the_next_picture_on_and_blocks_keep_their_index(
    wire: Wire, signatures: str
) -> None:
    assert wire.component.fixed == {}
    wire.give(IMAGE, image(SQUARE, 1))
    (before,) = blocks_in(wire.give(IMAGE, image(SQUARE, 2)))
    changed_parameters(wire, signatures, min_block_area=100)
    (after,) = blocks_in(wire.give(IMAGE, image(SQUARE, 3)))
    assert (after.index, after.age) == (before.index, before.age + 1)
    changed_parameters(wire, signatures, min_block_area=2500)
    assert blocks_in(wire.give(IMAGE, image(SQUARE, 4))) == []


def test_another_file_of_signatures_is_read_and_a_wrong_one_refused_without_effect(
    wire: Wire, signatures: str, tmp_path: Path
) -> None:
    save_signatures(tmp_path / "green.yaml", [GROUPS["G1"][1]])
    with pytest.raises(SignatureError, match=r"missing\.yaml"):
        changed_parameters(wire, str(tmp_path / "missing.yaml"), min_block_area=2500)
    wire.give(IMAGE, image(SQUARE, 1))
    assert len(blocks_in(wire.give(IMAGE, image(SQUARE, 2)))) == 1
    changed_parameters(wire, str(tmp_path / "green.yaml"))
    assert blocks_in(wire.give(IMAGE, image(SQUARE, 3))) == []


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"min_block_area": 3}, "'min_block_area' is 3, outside 4 to 2500 cells"),
        ({"signature_range": [5.0, 26.0]}, "'signature_range' is 26.0, outside 0.0 to 25.0"),
        ({"signature_range": [1.0] * 8}, "give at most 7"),
        ({"color_code_mode": 4}, "'color_code_mode' can't be 4"),
        ({"block_filtering": 2.5}, "must be of type int"),
    ],
)
def test_a_parameter_out_of_range_is_refused_with_its_range(
    wire: Wire, signatures: str, values: Any, words: str
) -> None:
    with pytest.raises(ParameterError, match=re.escape(words)):
        changed_parameters(wire, signatures, **values)
