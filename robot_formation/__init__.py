"""Robot formation control on an unknown curved surface by Koopman prediction and a Pixy2 camera.

What this package offers to Python programs is described in docs/reference/python_api.md:

    import robot_formation as rf

    scenario = rf.load_scenario("track_two").changed(seed=3, predictor="measured")
    run = rf.run(scenario)
    print(run.summary())
    run.followers["follower_1"].moved   # array (timesteps, 2): metres to the right and forward

Importing the package loads nothing else: a name is imported when it is used first.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robot_formation.api.choices import leader_paths as leader_paths
    from robot_formation.api.choices import predictors as predictors
    from robot_formation.api.choices import scenarios as scenarios
    from robot_formation.api.choices import sensors as sensors
    from robot_formation.api.choices import surfaces as surfaces
    from robot_formation.api.forecasts import Forecasts as Forecasts
    from robot_formation.api.forecasts import forecast as forecast
    from robot_formation.api.plots import plot_corrections as plot_corrections
    from robot_formation.api.plots import plot_eigenvalues as plot_eigenvalues
    from robot_formation.api.plots import plot_errors as plot_errors
    from robot_formation.api.plots import plot_sweep as plot_sweep
    from robot_formation.api.plots import plot_trajectory as plot_trajectory
    from robot_formation.api.runs import Follower as Follower
    from robot_formation.api.runs import Leader as Leader
    from robot_formation.api.runs import Run as Run
    from robot_formation.api.runs import analyze as analyze
    from robot_formation.api.runs import run as run
    from robot_formation.api.scenarios import Scenario as Scenario
    from robot_formation.api.scenarios import load_scenario as load_scenario
    from robot_formation.api.scores import Score as Score
    from robot_formation.api.scores import score as score
    from robot_formation.api.sweeps import Sweep as Sweep
    from robot_formation.api.sweeps import load_sweep as load_sweep
    from robot_formation.api.sweeps import sweep as sweep
    from robot_formation.errors import FormationError as FormationError

__version__ = "0.1.0"

# Where each public name is defined, below this package.
_PLACES = {
    "FormationError": ".errors",
    **dict.fromkeys(("Scenario", "load_scenario"), ".api.scenarios"),
    **dict.fromkeys(("Follower", "Leader", "Run", "analyze", "run"), ".api.runs"),
    **dict.fromkeys(("Sweep", "load_sweep", "sweep"), ".api.sweeps"),
    **dict.fromkeys(("Forecasts", "forecast"), ".api.forecasts"),
    **dict.fromkeys(("Score", "score"), ".api.scores"),
    **dict.fromkeys(
        ("plot_corrections", "plot_eigenvalues", "plot_errors", "plot_sweep", "plot_trajectory"), ".api.plots"
    ),
    **dict.fromkeys(("leader_paths", "predictors", "scenarios", "sensors", "surfaces"), ".api.choices"),
}

__all__ = [  # noqa: RUF022 - in the order of the reference page
    "__version__",
    "FormationError",
    "load_scenario",
    "Scenario",
    "run",
    "analyze",
    "Run",
    "Leader",
    "Follower",
    "sweep",
    "load_sweep",
    "Sweep",
    "forecast",
    "Forecasts",
    "score",
    "Score",
    "plot_trajectory",
    "plot_corrections",
    "plot_errors",
    "plot_eigenvalues",
    "plot_sweep",
    "scenarios",
    "leader_paths",
    "surfaces",
    "predictors",
    "sensors",
]


def __getattr__(name: str) -> object:
    """Import a public name when it is used first (PEP 562)."""
    place = _PLACES.get(name)
    if place is None:
        raise AttributeError(f"module '{__name__}' has no attribute '{name}'")
    found: object = getattr(importlib.import_module(place, __name__), name)
    globals()[name] = found
    return found


def __dir__() -> list[str]:
    return sorted({*globals(), *_PLACES})
