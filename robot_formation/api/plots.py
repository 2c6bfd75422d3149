"""The standard figures, on axes of one's own."""

from __future__ import annotations

from typing import TYPE_CHECKING

from robot_formation.analysis.style import styled
from robot_formation.errors import FormationError, shown
from robot_formation.parameters import suggestion

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from robot_formation.analysis.quantities import FollowerAnalysis
    from robot_formation.analysis.run_record import FollowerRecord
    from robot_formation.api.runs import Run
    from robot_formation.api.sweeps import Sweep


@styled
def plot_trajectory(run: Run, axes: Axes | None = None, *, overhead: bool = False) -> Axes:
    """Draw the robots' true paths from above over contour lines of the ground: centimetres of the world.

    Args:
        run: the run.
        axes: what to draw into; None: those of a new pyplot figure.
        overhead: whether to mark where the camera above the plate saw the robots.

    Returns:
        The axes.
    """
    from robot_formation.analysis.figures import trajectory_panel

    _check(run)
    axes = _axes(axes, (7.2, 7.2))
    trajectory_panel(axes, run.record, run.analysis, overhead=overhead)
    _legend(axes)
    return axes


@styled
def plot_corrections(run: Run, axes: Axes | None = None, *, follower: str = "follower_1") -> Axes:
    """Draw a follower's correction distance in each timestep, u on v: centimetres.

    Args:
        run: the run.
        axes: what to draw into; None: those of a new pyplot figure.
        follower: whose.

    Returns:
        The axes.

    Raises:
        FormationError: the run has no such follower.
    """
    from robot_formation.analysis.figures import corrections_panel

    _, found = _of(run, follower)
    axes = _axes(axes, (8.0, 3.2))
    corrections_panel(axes, run.record, run.analysis, found)
    axes.set_xlabel("timestep")
    _legend(axes)
    return axes


@styled
def plot_errors(run: Run, axes: Axes | None = None, *, follower: str = "follower_1") -> Axes:
    """Draw a follower's formation error while the run goes on, and at the ends of timesteps: centimetres over seconds.

    Args:
        run: the run.
        axes: what to draw into; None: those of a new pyplot figure.
        follower: whose.

    Returns:
        The axes.

    Raises:
        FormationError: the run has no such follower.
    """
    from robot_formation.analysis.error_figure import error_panel

    record, found = _of(run, follower)
    axes = _axes(axes, (8.0, 3.2))
    error_panel(axes, run.record, record, found)
    axes.set_ylim(bottom=0.0)
    axes.set_xlabel("simulated time (s)")
    _legend(axes)
    return axes


@styled
def plot_eigenvalues(run: Run, axes: Axes | None = None, *, follower: str = "follower_1") -> Axes:
    """Draw the eigenvalues of K, online DMD of a follower's displacements, in the complex plane with the unit circle.

    Args:
        run: the run, whatever its predictor.
        axes: what to draw into, a colour bar beside it; None: those of a new pyplot figure.
        follower: whose.

    Returns:
        The axes.

    Raises:
        FormationError: the run has no such follower.
    """
    from robot_formation.analysis.eigenvalue_figure import eigenvalue_plane, eigenvalues_over, forgetting

    record, _ = _of(run, follower)
    axes = _axes(axes, (5.0, 4.2))
    eigenvalue_plane(axes, eigenvalues_over(record, forgetting(run.record)))
    return axes


@styled
def plot_sweep(
    sweep: Sweep, axes: Axes | None = None, *, track: str | None = None, surface: str | None = None,
    path: str | None = None,
) -> Axes:  # fmt: skip
    """Draw every run's correction distance by predictor, with medians and their 95 % intervals: centimetres.

    Args:
        sweep: the sweep.
        axes: what to draw into; None: those of a new pyplot figure.
        track: name of the track or scenario; needed only if the sweep has several. So are the next two.
        surface: name of the surface.
        path: name of the leader's path.

    Returns:
        The axes.

    Raises:
        FormationError: the sweep has no such runs, or those of several.
    """
    from robot_formation.analysis.sweep_figure import sweep_groups, sweep_panel
    from robot_formation.api.sweeps import Sweep

    if not isinstance(sweep, Sweep):
        raise FormationError(f"give a sweep, like load_sweep('my_sweep'), not {shown(sweep)}")
    groups = sweep_groups(sweep.rows)
    wanted = (track, path, surface)
    chosen = [group for group in groups if all(want in (None, name) for want, name in zip(wanted, group, strict=True))]
    if len(chosen) != 1:
        said = "; ".join(f"track='{a}', path='{b}', surface='{c}'" for a, b, c in groups)
        raise FormationError(f"the sweep has {len(chosen)} groups of runs that fit; choose one of: {said}")
    runs = groups[chosen[0]]
    axes = _axes(axes, (max(4.8, 0.95 * len(sweep.plan.predictors) + 1.0), 3.6))
    sweep_panel(axes, runs, sweep.plan.predictors)
    axes.set_ylabel("correction distance\nfrom timestep 4 on (cm)")
    _legend(axes)
    return axes


def _axes(axes: Axes | None, size: tuple[float, float]) -> Axes:
    from matplotlib.axes import Axes

    if isinstance(axes, Axes):
        return axes
    if axes is not None:
        raise FormationError(f"axes are those of a matplotlib figure, not {shown(axes)}")
    from matplotlib import pyplot

    return pyplot.subplots(figsize=size, layout="constrained")[1]


def _legend(axes: Axes) -> None:
    """Make a legend that lists each label once, on a ground of its own: lines may run below it."""
    handles = {handle.get_label(): handle for handle in axes.get_legend_handles_labels()[0]}
    axes.legend(handles=list(handles.values()), loc="best", fontsize="small", frameon=True, framealpha=0.85)


def _of(run: Run, follower: str) -> tuple[FollowerRecord, FollowerAnalysis]:
    """Return a follower's record and its quantities."""
    _check(run)
    for record, found in zip(run.record.followers, run.analysis.followers, strict=True):
        if record.name == follower:
            return record, found
    names = [record.name for record in run.record.followers]
    raise FormationError(f"the run has no follower '{follower}'{suggestion(str(follower), names)}")


def _check(run: object) -> None:
    from robot_formation.api.runs import Run

    if not isinstance(run, Run):
        raise FormationError(f"give a run, like analyze('my_bag'), not {shown(run)}")
