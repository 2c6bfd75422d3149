"""The follower's camera out of a bag: recorded pictures, rendered ones, and the blocks that belong to them."""

from collections.abc import Iterator

import numpy as np
import pytest

from repository import ROOT
from robot_formation import names
from robot_formation.bag.errors import BagError
from robot_formation.bag.formation_bag import FormationBag
from robot_formation.bag.reader import read_bag
from robot_formation.viewing.replayed_camera import ReplayedCamera

FOLLOWER = names.follower(1)
IMAGE = names.camera_image().of(FOLLOWER)
SAMPLES = ROOT / "bags" / "samples"
NOISE = 1.92
"""Standard deviation of the sensor's noise in the sample's pictures, 8-bit levels: what their spread in a look is."""


class Without(FormationBag):
    """A bag as if some topics had not been recorded."""

    def __init__(self, bag: FormationBag, *hidden: str) -> None:
        super().__init__(bag.bag)
        self._hidden = hidden

    @property
    def topics(self) -> dict[str, str]:
        return {name: kind for name, kind in super().topics.items() if name not in self._hidden}


@pytest.fixture
def with_pictures() -> Iterator[FormationBag]:
    with read_bag(SAMPLES / "pictures") as bag:
        yield FormationBag(bag)


@pytest.fixture
def without_pictures() -> Iterator[FormationBag]:
    with read_bag(SAMPLES / "track_two_formation") as bag:
        yield FormationBag(bag)


def test_rendered_pictures_are_the_recorded_ones_without_their_noise(with_pictures: FormationBag) -> None:
    recorded = ReplayedCamera(with_pictures, FOLLOWER)
    rendered = ReplayedCamera(Without(with_pictures, IMAGE), FOLLOWER)
    assert not recorded.rendered
    assert rendered.rendered
    assert rendered.known_world
    assert recorded.stamps_ns.tolist() == rendered.stamps_ns.tolist()
    for stamp_ns in recorded.stamps_ns.tolist():
        seen, made = recorded.view(stamp_ns), rendered.view(stamp_ns)
        difference = seen.picture.astype(float) - made.picture
        assert np.abs(difference).max() < 8.0 * NOISE  # edges that are a pixel off differ by more than 80
        assert difference.std() == pytest.approx(NOISE, rel=0.05)
        assert seen.blocks == made.blocks


def test_pictures_of_other_places_are_told_from_noise(with_pictures: FormationBag) -> None:
    rendered = ReplayedCamera(Without(with_pictures, IMAGE), FOLLOWER)
    first, last = (rendered.view(int(rendered.stamps_ns[index])).picture for index in (0, -1))
    assert np.abs(first.astype(float) - last).max() > 8.0 * NOISE


def test_a_recorded_picture_stays_with_its_blocks_until_the_next(with_pictures: FormationBag) -> None:
    camera = ReplayedCamera(with_pictures, FOLLOWER)
    before, after = camera.stamps_ns[12:14].tolist()  # the first look's last frame, the second's first
    last, between, following = (camera.view(stamp) for stamp in (before, after - 1, after))
    assert between.blocks == last.blocks != ()
    assert np.array_equal(between.picture, last.picture)
    assert not np.array_equal(following.picture, last.picture)
    assert np.array_equal(camera.view(0).picture, camera.view(int(camera.stamps_ns[0])).picture)


def test_a_rendered_picture_has_no_blocks_once_a_robot_has_moved(without_pictures: FormationBag) -> None:
    camera = ReplayedCamera(without_pictures, FOLLOWER)
    looked = int(camera.stamps_ns[31])  # the last frame before the leader moves
    assert camera.stamps_ns[32] - looked > 10**9
    assert camera.view(looked).blocks
    assert camera.view(looked + 10**7).blocks == camera.view(looked).blocks
    moving = camera.view(looked + 5 * 10**8)
    assert moving.blocks == ()
    assert not np.array_equal(moving.picture, camera.view(looked).picture)


def test_without_blocks_a_bag_still_gives_pictures(without_pictures: FormationBag) -> None:
    camera = ReplayedCamera(Without(without_pictures, names.BLOCKS.of(FOLLOWER)), FOLLOWER)
    assert camera.view(10**9).blocks == ()
    assert np.array_equal(camera.view(10**9).picture, ReplayedCamera(without_pictures, FOLLOWER).view(10**9).picture)


def test_neither_pictures_nor_ground_truth_is_said(without_pictures: FormationBag) -> None:
    with pytest.raises(BagError, match=r"neither pictures nor true poses of follower_1.*record one of them"):
        ReplayedCamera(Without(without_pictures, names.ground_truth_odom(FOLLOWER).of()), FOLLOWER)
