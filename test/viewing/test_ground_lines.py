"""Contour lines and lines on the ground, against surfaces whose heights are known."""

import numpy as np

from robot_formation.analysis.run_record import Ground
from robot_formation.surface import surface_from_texts
from robot_formation.viewing.ground_lines import GroundHeight, contour_lines


def mesh(name: str, cells: int = 60) -> Ground:
    surface = surface_from_texts(name, ())
    ticks = np.linspace(0.0, surface.size_m, cells + 1)
    xs, ys = np.meshgrid(ticks, ticks)
    vertices = np.column_stack([xs.ravel(), ys.ravel(), surface.heights(xs, ys).ravel()])
    corner = (np.arange(cells)[:, None] * (cells + 1) + np.arange(cells)).ravel()
    right, up = corner + 1, corner + cells + 1
    triangles = np.concatenate([np.column_stack([corner, right, up + 1]), np.column_stack([corner, up + 1, up])])
    return Ground(vertices, triangles)


def test_contour_lines_of_the_bowl_are_circles_of_their_heights() -> None:
    surface = surface_from_texts("bowl", ())
    middle = np.full(2, 0.5 * surface.size_m)
    lines = contour_lines(mesh("bowl"))
    assert len(lines) == 9
    assert [height for height, _ in lines] == sorted(height for height, _ in lines)
    for height, segments in lines:
        points = segments.reshape(-1, 3)
        assert np.allclose(points[:, 2], height)
        assert np.allclose(surface.heights(points[:, 0], points[:, 1]), height, atol=1e-4)
        radii = np.linalg.norm(points[:, :2] - middle, axis=1)
        assert np.ptp(radii) < 0.01


def test_segments_of_a_closed_contour_meet() -> None:
    _, segments = contour_lines(mesh("bowl"))[2]
    ends, counts = np.unique(segments.reshape(-1, 3).round(6), axis=0, return_counts=True)
    assert len(ends) > 20
    assert set(counts.tolist()) == {2}


def test_level_ground_has_no_contour_lines() -> None:
    assert contour_lines(mesh("plane")) == []


def test_heights_are_those_of_the_ground() -> None:
    surface, points = surface_from_texts("saddle", ()), np.array([[0.5, 0.7], [1.0, 0.2]])
    heights = GroundHeight(mesh("saddle")).on_ground(points, 0.1)
    assert np.allclose(heights[:, 2] - 0.1, surface.heights(points[:, 0], points[:, 1]), atol=1e-3)
    assert GroundHeight().of(points).tolist() == [0.0, 0.0]
    assert GroundHeight(mesh("saddle")).of(np.array([[-5.0, 0.0]])).tolist() == [0.0]
