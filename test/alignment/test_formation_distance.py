"""The place as parameters: alignments by rendered pictures end beside the neighbour at that distance and offset."""

from dataclasses import replace

import pytest

from robot_formation.alignment.paper_mode import AlignmentParameters
from robot_formation.calibration.alignment_trial import AlignmentTrial, Equipment, Start
from robot_formation.components.node_parameters import BlockDetectorNodeParameters, WorldNodeParameters
from robot_formation.drive.movement_system import DriveParameters
from robot_formation.experiment.node_defaults import node_defaults
from robot_formation.follower.fine_tuning import AlignmentModeName, FineTunerParameters
from robot_formation.geometry.se2 import FORMATION_DISTANCE_M
from robot_formation.geometry.slots import slot
from robot_formation.parameters import ParameterError, from_mapping
from robot_formation.surface import make_surface


def equipment(mode: AlignmentModeName, distance_m: float, ahead_m: float = 0.0) -> Equipment:
    """The default robots on level ground."""
    return Equipment(
        make_surface("plane"),
        from_mapping(WorldNodeParameters, node_defaults("world"), where="world"),
        DriveParameters(),
        from_mapping(BlockDetectorNodeParameters, node_defaults("block_detector"), where="block_detector"),
        FineTunerParameters(mode=mode, formation_distance_m=distance_m, formation_ahead_m=ahead_m),
    )


@pytest.mark.slow
@pytest.mark.parametrize("mode", list(AlignmentModeName))
@pytest.mark.parametrize("distance_m", [0.30, 0.35])
def test_an_alignment_ends_in_formation_at_the_distance_that_is_asked_for(
    mode: AlignmentModeName, distance_m: float
) -> None:
    trial = AlignmentTrial(equipment(mode, distance_m), Start(0.33, 0.02, 0.0), seed=4).run()
    assert trial.outcome == "aligned"
    assert not trial.touched
    u_m, v_m, _ = trial.errors  # of the formation with this distance
    assert u_m == pytest.approx(0.0, abs=0.016)
    assert v_m == pytest.approx(0.0, abs=0.008)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("mode", "ahead_m"), [("precise", -0.1), ("precise", 0.12), ("paper", -0.025), ("paper", 0.025)]
)
def test_an_alignment_ends_ahead_or_behind_as_it_is_asked_for(mode: str, ahead_m: float) -> None:
    start = Start(0.33, ahead_m + 0.02, 0.0)
    trial = AlignmentTrial(equipment(AlignmentModeName(mode), 0.32, ahead_m), start, seed=4).run()
    assert trial.outcome == "aligned"
    u_m, v_m, yaw_rad = trial.errors  # of the formation with this offset
    assert (u_m, v_m, yaw_rad) == pytest.approx((0.0, 0.0, 0.0), abs=0.016)
    assert v_m == pytest.approx(0.0, abs=0.008)


def test_at_the_distance_of_the_calibration_it_holds_as_it_is() -> None:
    assert AlignmentParameters().at_place(slot(FORMATION_DISTANCE_M)) == AlignmentParameters()


def test_nearer_by_some_way_the_lens_is_so_much_nearer_and_columns_change_more() -> None:
    p = AlignmentParameters()
    near = p.at_place(slot(FORMATION_DISTANCE_M - 0.02))
    assert near.distance_m == pytest.approx(p.distance_m - 0.02)
    assert near.slope_px_per_m * near.distance_m == pytest.approx(p.slope_px_per_m * p.distance_m)  # focal length
    assert replace(near, distance_m=p.distance_m, slope_px_per_m=p.slope_px_per_m) == p


def test_ahead_of_its_neighbour_a_camera_sees_it_farther_to_the_left() -> None:
    p = AlignmentParameters()
    ahead = p.at_place(slot(FORMATION_DISTANCE_M, 0.02))
    assert ahead.target_x_px == pytest.approx(p.target_x_px - 0.02 * p.slope_px_per_m)
    assert replace(ahead, target_x_px=p.target_x_px) == p


@pytest.mark.parametrize("ahead_m", [-0.04, 0.04])
def test_the_papers_rules_keep_no_place_from_where_two_faces_show(ahead_m: float) -> None:
    with pytest.raises(ParameterError, match=r"'mode' paper can't keep a place 0\.04 m .* as up to 0\.03 m"):
        FineTunerParameters(mode=AlignmentModeName.PAPER, formation_ahead_m=ahead_m)
    FineTunerParameters(mode=AlignmentModeName.PRECISE, formation_ahead_m=ahead_m)


def test_a_distance_at_which_the_bodies_would_not_keep_clear_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"must be at least 0\.263"):
        FineTunerParameters(formation_distance_m=0.25)
    with pytest.raises(ParameterError, match="between lens and Target face"):
        FineTunerParameters(
            mode=AlignmentModeName.PAPER, formation_distance_m=0.06, alignment=AlignmentParameters(distance_m=0.2)
        )
