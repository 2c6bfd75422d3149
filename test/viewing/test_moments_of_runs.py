"""What viewers show of a run: the same from its bag and from its messages as they come."""

import itertools
import math
from collections.abc import Collection, Iterator

import numpy as np
import pytest

from repository import ROOT
from robot_formation import conversions, names
from robot_formation.bag.errors import BagError
from robot_formation.bag.formation_bag import FormationBag
from robot_formation.bag.reader import read_bag
from robot_formation.bag.source import RawMessage
from robot_formation.geometry.slots import slot
from robot_formation.viewing.live_moments import LiveMoments
from robot_formation.viewing.run_moments import RunMoments

pytestmark = pytest.mark.xdist_group("moments")

FOLLOWER = names.follower(1)
SAMPLE = ROOT / "bags" / "samples" / "track_two_formation"


@pytest.fixture(scope="module")
def bag() -> Iterator[FormationBag]:
    with read_bag(SAMPLE) as opened:
        yield FormationBag(opened)


@pytest.fixture(scope="module")
def run(bag: FormationBag) -> RunMoments:
    return RunMoments(bag)


def test_at_the_end_of_each_timestep_the_place_is_the_formation_error_away(run: RunMoments) -> None:
    figures = run.figures[FOLLOWER]
    assert len(figures) == 20
    for figure, displacement in zip(figures, run.record.followers[0].displacements, strict=True):
        moment = run.at(displacement.stamp_ns)
        now, pose = moment.followers[FOLLOWER], moment.robots[FOLLOWER]
        assert now.finished == figure.t
        assert now.place is not None
        away_m = math.hypot(pose.position_m[0] - now.place.x_m, pose.position_m[1] - now.place.y_m)
        assert away_m == pytest.approx(figure.error_m)


def test_a_forecast_begins_where_the_follower_stands_and_ends_near_where_it_will(run: RunMoments) -> None:
    ends = [d.stamp_ns for d in run.record.followers[0].displacements]
    for before, after in itertools.pairwise(ends[5:]):
        forecast = run.at(before).followers[FOLLOWER].forecast
        assert forecast is not None
        stood, stands = (run.record.tracks[FOLLOWER].at(stamp) for stamp in (before, after))
        assert stood is not None
        assert stands is not None
        assert math.hypot(forecast.start.x_m - stood.x_m, forecast.start.y_m - stood.y_m) < 1e-9
        assert math.hypot(forecast.end.x_m - stands.x_m, forecast.end.y_m - stands.y_m) < 0.02


def test_wheels_are_the_recorded_ones(run: RunMoments, bag: FormationBag) -> None:
    topic = names.joint_states(FOLLOWER).of()
    messages = list(bag.messages([topic]))
    for message in (messages[0], messages[100], messages[-1]):
        shown = run.at(message.stamp_ns).robots[FOLLOWER].joints_rad
        assert shown == dict(zip(message.message.name, message.message.position.tolist(), strict=True))
    assert run.at(run.start_ns - 1).robots[FOLLOWER].joints_rad == {}


def test_instants_are_bounded_and_cover_the_run(run: RunMoments) -> None:
    assert len(run.instants(50)) <= 51
    assert run.instants(50)[0] == run.start_ns
    assert run.end_ns - run.instants(10_000)[-1] < 10**8
    assert len(run.path(FOLLOWER, 30)) == 30
    assert run.path(FOLLOWER)[-1].tolist() == run.record.tracks[FOLLOWER].positions_m[-1].tolist()


def test_messages_as_they_come_give_what_the_bag_gives(run: RunMoments, bag: FormationBag) -> None:
    live = LiveMoments((names.LEADER, FOLLOWER), [run.record.place(FOLLOWER)])
    handlers = {f"/{t.name}": (t, take) for t, take in {**live.history(), **live.latest(), **live.pictures()}.items()}
    ends = [d.stamp_ns for d in run.record.followers[0].displacements]
    checks = iter(ends[4:19:5])
    check_ns, checked = next(checks), 0
    for raw in bag.raw_messages([name for name in handlers if name in bag.topics]):
        if raw.stamp_ns > check_ns + 10**6:  # messages of one instant have log times that count on
            told, recorded = live.at_present(), run.at(check_ns)
            assert told.robots == recorded.robots
            assert told.followers[FOLLOWER].finished == recorded.followers[FOLLOWER].finished
            assert told.followers[FOLLOWER].place == recorded.followers[FOLLOWER].place
            assert told.followers[FOLLOWER].words == recorded.followers[FOLLOWER].words
            one, other = told.followers[FOLLOWER].forecast, recorded.followers[FOLLOWER].forecast
            assert one is not None
            assert other is not None
            assert np.allclose(one.ellipse(), other.ellipse(), atol=1e-12)
            checked += 1
            check_ns = next(checks, 10**18)
        topic, take = handlers[raw.topic]
        take(conversions.from_cdr(raw.cdr, topic.type))
    assert checked == 3
    assert live.picture(FOLLOWER) is None  # this bag has none


def test_a_live_picture_has_the_blocks_of_its_frame() -> None:
    with read_bag(ROOT / "bags" / "samples" / "pictures") as opened:
        bag = FormationBag(opened)
        live = LiveMoments((names.LEADER, FOLLOWER), [slot(0.32)])
        handlers = {f"/{topic.name}": (topic, take) for topic, take in live.pictures().items()}
        for raw in bag.raw_messages([name for name in handlers if name in bag.topics]):
            topic, take = handlers[raw.topic]
            take(conversions.from_cdr(raw.cdr, topic.type))
    found = live.picture(FOLLOWER)
    assert found is not None
    assert found[1].shape == (3 * 208, 3 * 316, 3)


class WithoutTruth(FormationBag):
    """A bag as real robots give it."""

    @property
    def topics(self) -> dict[str, str]:
        return {name: kind for name, kind in super().topics.items() if "ground_truth" not in name}

    def raw_messages(self, topics: Collection[str]) -> Iterator[RawMessage]:
        return super().raw_messages([topic for topic in topics if topic in self.topics])


def test_a_bag_without_true_poses_is_refused_in_one_line(bag: FormationBag) -> None:
    with pytest.raises(BagError, match=r"no true poses.*record '/ground_truth/leader/odom'"):
        RunMoments(WithoutTruth(bag.bag))
