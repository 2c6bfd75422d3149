"""Odometry of a topic: poses of all messages at once are those of the messages one by one."""

import numpy as np
import pytest
from numpy.typing import NDArray

from repository import ROOT
from robot_formation import conversions, names
from robot_formation.bag import odometry
from robot_formation.bag.errors import BagError
from robot_formation.bag.formation_bag import FormationBag
from robot_formation.bag.odometry import Odometry, _columns
from robot_formation.bag.reader import read_bag
from robot_formation.geometry.orientation import Quaternion

TOPIC = names.ground_truth_odom(names.LEADER).of()


def recorded() -> list[bytes]:
    with read_bag(ROOT / "bags" / "samples" / "track_two_formation") as bag:
        return [raw.cdr for raw in FormationBag(bag).raw_messages([TOPIC])]


def one(child: str, x_m: float, stamp_ns: int, turn: Quaternion = (0.0, 0.6, 0.0, 0.8)) -> bytes:
    return conversions.body_odometry(
        (x_m, 2.0, 3.0), turn, (0.0,) * 3, (0.0,) * 3, frame="world", child=child, stamp_ns=stamp_ns
    )


def poses_of(cdr: list[bytes]) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    found = Odometry("bag: 'topic'")
    for message in cdr:
        found.add(message)
    return found.poses()


@pytest.mark.parametrize(
    "cdr",
    [
        recorded(),
        [one("a/base_link", 1.0, 5), one("a/base_link", 1.5, 7 * 10**9 + 3)],
        [one("a", 1.0, 5), one("longer", 1.5, 6)],
    ],
    ids=["recorded", "made", "frames that differ"],
)
def test_columns_are_what_the_messages_hold(cdr: list[bytes]) -> None:
    stamps_ns, positions_m, orientations = poses_of(cdr)
    assert len(stamps_ns) == len(cdr)
    for index in {0, len(cdr) // 2, len(cdr) - 1}:
        message = conversions.from_cdr(cdr[index], "nav_msgs/msg/Odometry")
        p, o = message.pose.pose.position, message.pose.pose.orientation
        assert positions_m[index].tolist() == [p.x, p.y, p.z]
        assert orientations[index].tolist() == [o.x, o.y, o.z, o.w]
        assert stamps_ns[index] == conversions.stamp_of(message)


def test_poses_read_in_parts_are_those_read_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    cdr = [*recorded(), one("longer", 1.5, 6)]
    whole = poses_of(cdr)
    monkeypatch.setattr(odometry, "_READ_AT_ONCE", 7)
    for at_once, in_parts in zip(whole, poses_of(cdr), strict=True):
        assert np.array_equal(at_once, in_parts)


def test_messages_with_the_same_frames_are_read_at_once_and_others_one_by_one() -> None:
    assert _columns(recorded()) is not None
    assert _columns([one("a", 1.0, 5), one("longer", 1.5, 6)]) is None
    assert _columns([b"\0\1\0\0" + bytes(8) + b"\xff" * 8]) is None
    assert _columns([b""]) is None


def test_a_message_that_is_cut_off_is_an_error() -> None:
    whole = one("a", 1.0, 5)
    with pytest.raises(BagError, match=r"^bag: 'topic' holds a message that can't be read: "):
        poses_of([whole[:60]])


@pytest.mark.parametrize("child", ["a", "longer"])
def test_what_is_no_pose_is_left_out(child: str) -> None:
    good = [one("a", 1.0, 5), one(child, 1.5, 9)]
    nan = float("nan")
    bad = [one("a", nan, 6), one("a", float("inf"), 6), one("a", 1e300, 6), one("a", 1.0, 6, (0.0, 0.0, 0.0, 0.0))]
    bad += [one("a", 1.0, 6, (0.0, 0.0, 0.0, nan)), one("a", 1.0, 6, (0.0, 0.0, 0.0, 2.0))]
    stamps_ns, positions_m, orientations = poses_of([good[0], *bad, good[1]])
    assert stamps_ns.tolist() == [5, 9]
    assert positions_m[:, 0].tolist() == [1.0, 1.5]
    assert orientations.shape == (2, 4)
    assert len(poses_of(bad)[0]) == 0


def test_stamps_and_poses_are_numbers_of_their_types() -> None:
    for cdr in (recorded(), []):
        stamps_ns, positions_m, orientations = poses_of(cdr)
        assert stamps_ns.dtype == np.int64
        assert positions_m.shape == (len(cdr), 3)
        assert orientations.shape == (len(cdr), 4)
