"""Both sensors behind the same protocol: what the fine-tuner gets does not tell which one it comes from."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from component_helpers import Wire, wired
from robot_formation import conversions
from robot_formation.alignment.observation import bounding_boxes
from robot_formation.components.block_detector import BlockDetectorComponent
from robot_formation.components.node_parameters import BlockDetectorNodeParameters
from robot_formation.experiment.in_memory_record import run_in_memory
from robot_formation.experiment.in_process import InProcessRun
from robot_formation.experiment.node_defaults import node_defaults, parameter_file
from robot_formation.experiment.scenario import load, load_track, override
from robot_formation.parameters import ParameterError, flatten, from_mapping
from robot_formation.paths import config_dir
from robot_formation.surface import make_surface
from robot_formation.vision.marker import Face, MarkerKind
from robot_formation.vision.pixy2.block import Block
from robot_formation.vision.pixy2.block_tracking import ClockError
from robot_formation.vision.pixy2.picture import PictureError
from robot_formation.vision.sensors import BlockSensor
from robot_formation.world.camera import Camera
from robot_formation.world.parameters import WorldParameters
from robot_formation.world.pose import pose_on_surface
from robot_formation.world.sensor import Sensor
from tag_helpers import needs_tags

PLANE = make_surface("plane")
IMAGE, CAMERA = "camera/image_raw", "follower_1/camera_optical_frame"
FRAME_US = 33_333


def detector_of(wire: Wire) -> BlockDetectorComponent:
    assert isinstance(wire.component, BlockDetectorComponent)
    return wire.component


class Bench:
    """One kind of marker before a camera, and the sensor that goes with it."""

    def __init__(self, kind: str) -> None:
        self.kind = kind
        self.world = from_mapping(WorldParameters, {"marker": {"kind": kind}}, where="test")
        self.camera = Camera(PLANE, self.world)

    def picture(
        self, ahead_m: float = 0.0, aside_m: float = 0.32, yaw_rad: float = 0.0, seed: int = 0
    ) -> NDArray[np.uint8]:
        looking = pose_on_surface(PLANE, 0.89, 0.5, 0.0)
        seen = pose_on_surface(PLANE, 0.89 + ahead_m, 0.5 + aside_m, yaw_rad)
        sensor = Sensor(self.world.camera, seed, "test")
        return sensor.expose(sensor.develop(self.camera.light(looking, [seen])), 0.0)

    def wire(self, **values: Any) -> Wire:
        return wired(
            "block_detector", "follower_1", **{**node_defaults("block_detector"), "sensor": self.kind, **values}
        )

    def sensor(self, **values: Any) -> BlockSensor:
        """The component's detector, as the world's own camera node would use it."""
        return detector_of(self.wire(**values))._detector


@pytest.fixture(params=["colours", pytest.param("tags", marks=needs_tags)], scope="module")
def bench(request: pytest.FixtureRequest) -> Bench:
    return Bench(request.param)


@pytest.fixture
def wire(bench: Bench) -> Wire:
    return bench.wire(block_filtering=0)


def image(pixels: NDArray[np.uint8], number: int) -> Any:
    return conversions.image(pixels, CAMERA, number * FRAME_US * 1000)


def blocks(sent: list[tuple[str, Any]]) -> list[Block]:
    ((topic, message),) = sent
    assert topic == "blocks"
    return conversions.read_blocks(message)


def second_look(wire: Wire, picture: NDArray[np.uint8], first: int = 1) -> list[Block]:
    wire.give(IMAGE, image(picture, first))
    return blocks(wire.give(IMAGE, image(picture, first + 1)))


def test_in_formation_the_target_face_is_a_block_of_50_px_50_px_above_the_centre(bench: Bench, wire: Wire) -> None:
    (block,) = second_look(wire, bench.picture())
    assert (block.signature, block.angle) == (Face.TARGET, 0)
    assert (block.x, block.y) == pytest.approx((157.5, 53.4), abs=2.0)
    assert (block.width, block.height) == pytest.approx((50, 50), abs=4.0)


@needs_tags
@pytest.mark.parametrize(("yaw", "faces"), [(-0.7, {Face.TARGET, Face.FRONT}), (0.7, {Face.TARGET, Face.REAR})])
def test_signatures_name_the_same_faces_and_boxes_nearly_agree(
    bench: Bench, wire: Wire, yaw: float, faces: set[Face]
) -> None:
    found = bounding_boxes(second_look(wire, bench.picture(0.0, 0.34, yaw)))
    assert set(found) == faces
    other = Bench("tags" if bench.kind == "colours" else "colours")
    theirs = bounding_boxes(second_look(other.wire(block_filtering=0), other.picture(0.0, 0.34, yaw)))
    for face in faces:
        # Where two colours meet, the colours' boxes are off by up to 9 px.
        for side, most_px in (("left", 10.0), ("right", 10.0), ("top", 6.0), ("bottom", 6.0)):
            assert getattr(found[face], side) == pytest.approx(getattr(theirs[face], side), abs=most_px)


def test_index_stays_and_age_counts_while_a_block_moves(bench: Bench, wire: Wire) -> None:
    reports = [
        blocks(wire.give(IMAGE, image(bench.picture(0.002 * number, seed=number), number))) for number in range(1, 8)
    ]
    assert reports[0] == []
    assert [len(report) for report in reports[1:]] == [1] * 6
    assert len({report[0].index for report in reports[1:]}) == 1
    assert [report[0].age for report in reports[1:]] == list(range(6))
    assert reports[-1][0].x > reports[1][0].x


def test_the_papers_filtering_shows_a_block_in_its_21st_picture_and_keeps_it_for_ten(bench: Bench) -> None:
    wire = bench.wire()
    picture, empty = bench.picture(), np.full((208, 316, 3), 110, np.uint8)
    shown = [bool(blocks(wire.give(IMAGE, image(picture, number)))) for number in range(1, 23)]
    kept = [bool(blocks(wire.give(IMAGE, image(empty, number)))) for number in range(23, 40)]
    assert shown == [False] * 20 + [True] * 2
    assert kept == [True] * 10 + [False] * 7


def noise(seed: int) -> NDArray[np.uint8]:
    return np.random.default_rng(seed).integers(0, 256, (208, 316, 3), dtype=np.uint8)


def test_black_and_noise_are_answered_with_nothing_of_a_faces_size(wire: Wire) -> None:
    for number, picture in enumerate((np.zeros((208, 316, 3), np.uint8), noise(0), noise(1), noise(2)), 1):
        assert [block for block in blocks(wire.give(IMAGE, image(picture, number))) if block.width > 20] == []


def test_a_truncated_picture_is_dropped_and_the_next_one_answered(bench: Bench, wire: Wire) -> None:
    picture = bench.picture()
    cut = image(picture, 1)
    cut.data = cut.data[: len(cut.data) // 2]
    assert wire.give(IMAGE, cut) == []
    assert len(wire.warnings) == 1
    assert len(second_look(wire, picture, 2)) == 1


def test_a_picture_of_another_size_is_scaled(bench: Bench, wire: Wire) -> None:
    large = np.repeat(np.repeat(bench.picture(), 2, axis=0), 2, axis=1)
    (block,) = second_look(wire, large)
    assert (block.x, block.width) == pytest.approx((157.5, 50), abs=4.0)


def test_the_sensors_refuse_what_is_no_picture_and_time_that_goes_back(bench: Bench) -> None:
    sensor = bench.sensor(block_filtering=0)
    with pytest.raises(PictureError):
        sensor.process(np.zeros((10, 10, 3), np.uint8), 0)
    sensor.process(bench.picture(), 1000)
    with pytest.raises(ClockError):
        sensor.process(bench.picture(), 1000)
    sensor.reset()
    assert sensor.process(bench.picture(), 0) == []
    assert len(sensor.process(bench.picture(), FRAME_US)) == 1


def test_a_run_of_pictures_gives_the_same_blocks_twice(bench: Bench) -> None:
    runs = [bench.sensor(block_filtering=0) for _ in range(2)]
    pictures = [bench.picture(0.01 * number, 0.35, -0.5, seed=number) for number in range(6)]
    first, second = ([run.process(p, FRAME_US * n) for n, p in enumerate(pictures)] for run in runs)
    assert first == second


def changed(wire: Wire, **values: Any) -> None:
    defaults = {**node_defaults("block_detector"), "block_filtering": 0}
    detector_of(wire).set_parameters(
        from_mapping(BlockDetectorNodeParameters, {**defaults, **flatten(values)}, where="test")
    )


@needs_tags
def test_the_sensor_and_the_search_can_be_changed_while_the_node_runs() -> None:
    bench = Bench("tags")
    picture = bench.picture()
    wire = Bench("colours").wire(block_filtering=0)
    assert second_look(wire, picture, 1) == []
    changed(wire, sensor="tags")
    assert len(second_look(wire, picture, 3)) == 1
    changed(wire, sensor="tags", tags={"min_perimeter_px": 500.0})
    wire.give(IMAGE, image(picture, 5))
    assert blocks(wire.give(IMAGE, image(picture, 6))) == []
    changed(wire, sensor="colours")
    assert second_look(wire, Bench("colours").picture(), 7)


@needs_tags
def test_a_tag_detector_reads_no_signatures(tmp_path: Path) -> None:
    missing = str(tmp_path / "missing.yaml")
    assert Bench("tags").wire(signatures_file=missing)


def test_the_scenarios_marker_sets_the_world_the_sensor_and_the_calibration() -> None:
    scenario = override(load_track("two"), ["marker=tags"])
    scenario.check()
    assert scenario.world.marker.kind == scenario.block_detector.sensor == MarkerKind.TAGS
    assert scenario.fine_tuner.alignment.side_bias_px != 2.65
    assert scenario.drive == load_track("two").drive
    assert override(scenario, ["marker=colours"]) == load_track("two")


def test_what_a_scenario_says_comes_after_the_tags_calibration(tmp_path: Path) -> None:
    scenario = override(load_track("one"), ["marker=tags", "fine_tuner.alignment.side_bias_px=1.5"])
    assert scenario.fine_tuner.alignment.side_bias_px == 1.5
    path = tmp_path / "mine.yaml"
    path.write_text("marker: tags\nblock_detector: {tags: {window_px: 15}}\n", encoding="utf-8")
    found = load(path).block_detector
    assert (found.sensor, found.tags.window_px, found.block_filtering) == (MarkerKind.TAGS, 15, 40)


@pytest.mark.parametrize("setting", ["world.marker.kind=tags", "block_detector.sensor=tags", "marker=tag"])
def test_a_marker_and_a_sensor_that_do_not_belong_together_are_refused_in_one_line(setting: str) -> None:
    with pytest.raises(ParameterError, match="marker") as caught:
        override(load_track("two"), [setting])
    assert "\n" not in str(caught.value)


def test_the_files_for_tags_differ_from_config_and_hold_known_parameters() -> None:
    files = sorted((config_dir() / "tags").glob("*.yaml"))
    assert [file.stem for file in files] == ["block_detector", "fine_tuner", "world"]
    scenario = override(load_track("two"), ["marker=tags"])
    for file in files:
        colours, tags = load_track("two").by_node()[file.stem], scenario.by_node()[file.stem]
        assert {name for name in tags if tags[name] != colours[name]} == set(parameter_file(file))


@needs_tags
@pytest.mark.parametrize("mode", ["paper", "precise"])
def test_a_run_with_tags_comes_to_its_end_in_formation(mode: str) -> None:
    settings = ["marker=tags", f"fine_tuner.mode={mode}", "leader.timesteps=4", "seed=3"]
    settings += ["world.camera.mode=on_demand", "world.overhead.enabled=false", "predictor.name=previous"]
    scenario = override(load_track("two"), settings)
    warnings: list[str] = []

    record = run_in_memory(scenario, lambda its, listen: InProcessRun(its, listen=listen, warnings=warnings))
    assert record.details["outcome"] == "done"
    assert warnings == []
    assert len(record.followers[0].displacements) == 4
    assert not record.followers[0].lost
