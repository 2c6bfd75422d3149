"""The block detector on messages: every good picture is answered in its frame and with its stamp."""

import array

import numpy as np
import pytest
from component_helpers import wired
from vision_helpers import GREEN, GROUPS, RED, canvas

from robot_formation import conversions, names
from robot_formation.vision.block import Block
from robot_formation.vision.signatures import SignatureError, save_signatures

CAMERA, IMAGE = "follower_1/camera_optical_frame", "camera/image_raw"
SQUARE = canvas(((134, 60, 48, 48), RED))
EMPTY = canvas()


@pytest.fixture(scope="module")
def signatures(tmp_path_factory):
    path = tmp_path_factory.mktemp("signatures") / "taught.yaml"
    save_signatures(path, GROUPS["G1"])
    return str(path)


@pytest.fixture
def wire(signatures):
    """A detector without filtering: a block is reported from its second picture on."""
    return wired("block_detector", "follower_1", signatures_file=signatures, block_filtering=0)


def image(pixels, number):
    """The frame of this number at 30 frames per second."""
    return conversions.image(pixels, CAMERA, number * 33_333_333)


def blocks_in(sent):
    ((topic, message),) = sent
    assert topic == "blocks"
    return conversions.read_blocks(message)


def test_a_picture_is_answered_with_its_blocks_its_stamp_and_its_frame(wire):
    assert blocks_in(wire.give(IMAGE, image(SQUARE, 2))) == []
    ((_, message),) = sent = wire.give(IMAGE, image(SQUARE, 3))
    (found,) = blocks_in(sent)
    assert found.signature == 1
    assert (found.x, found.y, found.width, found.height) == pytest.approx((158, 84, 48, 48), abs=4)
    assert conversions.stamp_of(message) == 3 * 33_333_333
    assert message.header.frame_id == CAMERA
    assert wire.component.stamp_ns == 3 * 33_333_333


def test_a_picture_without_blocks_is_answered_too(wire):
    ((_, message),) = sent = wire.give(IMAGE, image(EMPTY, 1))
    assert blocks_in(sent) == []
    assert conversions.stamp_of(message) == 33_333_333


def test_blocks_are_tracked_from_picture_to_picture(wire):
    _, first, second = (blocks_in(wire.give(IMAGE, image(SQUARE, n))) for n in (1, 2, 3))
    assert (first[0].index, first[0].age + 1) == (second[0].index, second[0].age)


def test_block_filtering_of_the_paper_shows_a_block_in_its_21st_picture(signatures):
    wire = wired("block_detector", "follower_1", signatures_file=signatures, block_filtering=40)
    seen = [bool(blocks_in(wire.give(IMAGE, image(SQUARE, n)))) for n in range(22)]
    assert seen == [False] * 20 + [True] * 2


def cut_off():
    message = image(SQUARE, 1)
    message.data = array.array("B", message.data[:-1])
    return message


def colourless():
    message = image(SQUARE, 1)
    message.encoding = "mono8"
    return message


@pytest.mark.parametrize("bad", [cut_off(), colourless()], ids=["cut off", "colourless"])
def test_a_bad_picture_is_dropped_counted_and_warned_of(wire, bad):
    assert wire.give(IMAGE, bad) == []
    assert len(wire.warnings) == 1
    assert wire.component.details() == {"frames": "0", "dropped": "1"}
    assert wire.component.stamp_ns == 0
    answers = [blocks_in(wire.give(IMAGE, image(SQUARE, n))) for n in (1, 2)]
    assert [len(found) for found in answers] == [0, 1]


@pytest.mark.parametrize("number", [5, 4, 0])
def test_a_picture_that_is_not_later_than_the_one_before_is_dropped(wire, number):
    wire.give(IMAGE, image(SQUARE, 5))
    assert wire.give(IMAGE, image(SQUARE, number)) == []
    assert len(wire.warnings) == 1
    assert wire.component.details() == {"frames": "1", "dropped": "1"}
    (found,) = blocks_in(wire.give(IMAGE, image(SQUARE, 6)))
    assert found.age == 0  # as if it had never come


def test_the_other_order_of_colours_gives_the_same_blocks(wire, signatures):
    swapped = image(np.ascontiguousarray(SQUARE[:, :, ::-1]), 1)
    swapped.encoding = "bgr8"
    other = wired("block_detector", "follower_1", signatures_file=signatures, block_filtering=0)
    assert blocks_in(wire.give(IMAGE, image(SQUARE, 1))) == blocks_in(other.give(IMAGE, swapped)) == []
    swapped.header = image(SQUARE, 2).header
    found = blocks_in(wire.give(IMAGE, image(SQUARE, 2)))
    assert len(found) == 1
    assert blocks_in(other.give(IMAGE, swapped)) == found


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8"])
def test_larger_pictures_are_scaled_with_one_warning(wire, encoding):
    large = np.repeat(np.repeat(SQUARE, 2, axis=0), 2, axis=1)
    for number in (1, 2):
        message = image(np.ascontiguousarray(large[:, :, ::-1]) if encoding == "bgr8" else large, number)
        message.encoding = encoding
        found = blocks_in(wire.give(IMAGE, message))
    assert (found[0].x, found[0].y, found[0].width, found[0].height) == pytest.approx((158, 84, 48, 48), abs=4)
    assert wire.warnings == ["pictures of 632 x 416 are scaled to 316 x 208"]


@pytest.mark.parametrize("encoding", ["rgb8", "bgr8"])
def test_the_annotated_picture_is_made_only_while_somebody_listens(wire, encoding):
    def show(number):
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


def test_listeners_of_the_blocks_do_not_ask_for_the_picture(wire):
    wire.component.listened_to(names.BLOCKS, 1)
    assert len(wire.give(IMAGE, image(SQUARE, 1))) == 1


def test_blocks_of_every_taught_signature_are_reported(wire):
    pair = canvas(((60, 60, 40, 40), RED), ((200, 60, 50, 50), GREEN))
    wire.give(IMAGE, image(pair, 1))
    found = blocks_in(wire.give(IMAGE, image(pair, 2)))
    assert [block.signature for block in found] == [2, 1]  # the larger first
    assert all(isinstance(block, Block) for block in found)


def test_a_missing_signatures_file_is_said_in_one_line(tmp_path):
    with pytest.raises(SignatureError, match=r"missing\.yaml") as caught:
        wired("block_detector", "follower_1", signatures_file=str(tmp_path / "missing.yaml"))
    assert "\n" not in str(caught.value)
