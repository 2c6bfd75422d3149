"""What a look makes of one hypothesis: an iterated update, with stray edges, hidden faces and contradictions."""

import math

import numpy as np
import pytest

from alignment_helpers import EDGES, MODEL, blocks_of, state_of
from robot_formation.alignment.observation import bounding_boxes
from robot_formation.alignment.precise.marker_edges import Edge, View, view
from robot_formation.alignment.precise.marker_projection import Vector, X, Y
from robot_formation.alignment.precise.pose_hypothesis import Hypothesis, LookUpdate
from robot_formation.vision.marker import Face
from robot_formation.vision.pixy2.picture import WIDTH

UPDATE = LookUpdate(MODEL, EDGES)
PRIOR = np.diag([0.05**2, 0.05**2, 0.05**2, 0.05**2, 0.02**2, 0.02**2])


def seen_from(state: Vector) -> View:
    return view(bounding_boxes(blocks_of(state)), EDGES)


def shifted(seen: View, face: Face, side: str, by_px: float) -> View:
    """A look one of whose edges is off."""
    return View(
        tuple(
            Edge(e.face, e.side, e.position_px + (by_px if (e.face, e.side) == (face, side) else 0.0), e.sigma_px)
            for e in seen.edges
        ),
        seen.faces,
    )


def updated(prior: Vector, seen: View) -> Hypothesis:
    hypothesis = Hypothesis(prior, PRIOR)
    UPDATE.update(hypothesis, seen)
    return hypothesis


@pytest.mark.parametrize(("x_m", "y_m", "yaw_rad"), [(0.0, 0.32, 0.0), (0.12, 0.34, -0.1), (-0.1, 0.42, 0.4)])
def test_an_update_leads_from_a_wrong_place_to_the_true_one(x_m: float, y_m: float, yaw_rad: float) -> None:
    truth = state_of(x_m, y_m, yaw_rad)
    found = updated(truth + np.array([0.03, -0.03, 0.0, 0.02, 0.0, 0.0]), seen_from(truth))
    assert found.state[[X, Y]] == pytest.approx(truth[[X, Y]], abs=0.01)
    assert found.covariance[Y, Y] < 0.05 * PRIOR[Y, Y]
    assert np.linalg.eigvalsh(found.covariance).min() > 0.0


def test_the_likelier_of_two_headings_is_the_true_one() -> None:
    truth = state_of(0.13, 0.33, 0.0)
    costs = [updated(state_of(0.13, 0.33, yaw_rad), seen_from(truth)).cost for yaw_rad in (0.0, 0.3, -0.3)]
    assert costs[0] < min(costs[1:])


def test_a_stray_edge_pulls_with_limited_force() -> None:
    truth, moved = state_of(), []
    for by_px in (1.0, 10.0, 20.0):
        hypothesis = Hypothesis(truth, 0.01 * PRIOR)
        UPDATE.update(hypothesis, shifted(seen_from(truth), Face.TARGET, "top", by_px))
        moved.append(float(hypothesis.state[Y] - truth[Y]))
    assert moved[0] > 0.002
    # In proportion it would be ten and twenty times as far.
    assert moved[1] < 4.0 * moved[0]
    assert moved[2] == pytest.approx(moved[1], abs=0.001)


def test_an_update_without_edges_changes_nothing() -> None:
    hypothesis = updated(state_of(), View((), frozenset(Face)))
    assert hypothesis.state == pytest.approx(state_of())
    assert hypothesis.covariance is PRIOR
    assert hypothesis.cost == 0.0


def test_a_wide_face_that_was_not_reported_makes_a_heading_unlikely() -> None:
    truth = state_of(0.0, 0.32, 0.0)
    seen = seen_from(truth)
    assert seen.faces == {Face.TARGET}
    turned = state_of(0.0, 0.32, math.radians(-40.0))  # it would show a wide Front face
    assert UPDATE._contradiction(turned, seen) > 100.0
    assert UPDATE._contradiction(truth, seen) == 0.0


def test_a_reported_face_that_a_pose_turns_away_makes_it_unlikely() -> None:
    seen = seen_from(state_of(0.0, 0.4, -0.7))
    assert Face.FRONT in seen.faces
    assert UPDATE._contradiction(state_of(0.0, 0.4, 0.7), seen) > 50.0


def test_whole_markers_fit_some_pose_and_one_of_wrong_proportions_none() -> None:
    truth = state_of(0.02, 0.35, 0.05)
    assert UPDATE.fits(Hypothesis(truth + 0.01, PRIOR), seen_from(truth))
    narrow = shifted(seen_from(truth), Face.TARGET, "right", -20.0)
    assert not UPDATE.fits(Hypothesis(truth, PRIOR), narrow)


def test_the_nis_is_that_of_the_best_hypothesis_and_grows_with_the_innovation() -> None:
    truth = state_of()
    seen, sharp = seen_from(truth), 1e-3 * PRIOR
    near, far = Hypothesis(truth, sharp), Hypothesis(state_of(x_m=0.05), sharp)
    assert UPDATE.nis([near], seen) < 0.1
    assert UPDATE.nis([far], seen) > 5.0
    assert UPDATE.nis([far, near], seen) == UPDATE.nis([near], seen)
    assert UPDATE.nis([far], View((), frozenset())) == 0.0


@pytest.mark.parametrize(
    ("state", "cost", "sane"),
    [
        (state_of(), 0.0, True),
        (state_of(), math.inf, False),
        (state_of(x_m=math.nan), 0.0, False),
        (state_of(y_m=2.1), 0.0, False),
        (state_of(yaw_rad=-2.1), 0.0, False),
    ],
)
def test_a_hypothesis_is_about_a_neighbour_that_could_be_in_view(state: Vector, cost: float, sane: bool) -> None:
    assert Hypothesis(state, PRIOR, cost).sane is sane


def test_a_hidden_face_may_show_more_where_the_picture_cuts_it_off() -> None:
    look = View((), frozenset({Face.TARGET}))
    whole, cut = state_of(0.15, 0.32, -0.9), state_of(0.17, 0.32, -0.9)
    assert MODEL.shown(cut, (0.0, WIDTH))[Face.FRONT] > EDGES.front_shows_px
    assert MODEL.pixels(whole[None])[0, :, 0].max() < WIDTH < MODEL.pixels(cut[None])[0, :, 0].max()
    assert UPDATE._contradiction(whole, look) > 20.0
    assert UPDATE._contradiction(cut, look) == 0.0
