# ---
# jupyter:
#   jupytext:
#     text_representation:
#       extension: .py
#       format_name: percent
#   kernelspec:
#     display_name: Python 3
#     language: python
#     name: python3
# ---

# %% [markdown]
# # A surface and a robot of your own
#
# The robots know nothing of the ground: no map, no formula. So they have to manage on yours too. This notebook makes a
# surface, drives on it, and then changes the robots: their wheels, their grip, their noise.

# %%
import math
from dataclasses import dataclass

import matplotlib.pyplot as plt
import numpy as np

import robot_formation as rf
from robot_formation.testing import check_surface

# %% [markdown]
# ## A surface
#
# A surface needs one method: `height(x, y)`, metres, also beyond the plate's edge. Slopes are taken from it. Written as
# a frozen dataclass, its fields are parameters that a scenario can set. This one is a furrowed field.


# %%
@dataclass(frozen=True)
class Furrows:
    """Waves that run along one diagonal of the plate."""

    height_m: float = 0.008
    length_m: float = 0.8

    def height(self, x, y):
        """Height at a place, metres."""
        return self.height_m * math.sin(2.0 * math.pi * (x + y) / math.sqrt(2.0) / self.length_m)


check_surface(Furrows)

# %% [markdown]
# The contour lines of the figure below are of the plate, a square of 1.8 m, with the run on it. As with predictors, a
# class of this notebook is named `__main__:Furrows`, one in a file `my_module:Furrows`.

# %%
base = rf.load_scenario("track_two").changed(seed=3, camera="on_demand", timesteps=12)
furrowed = base.changed(surface="__main__:Furrows")
run = rf.run(furrowed)
print(run)

figure, axes = plt.subplots(figsize=(6, 6), layout="constrained")
rf.plot_trajectory(run, axes)
figure.savefig("furrows.png")
assert run.outcome == "done"

# %% [markdown]
# Its parameters are settings like any other:

# %%
runs = {"furrows of 8 mm": run}
for height_m in (0.004, 0.012):
    scenario = furrowed.changed(settings={"world.surface_parameters": [f"height_m={height_m}"]})
    runs[f"furrows of {1000 * height_m:.0f} mm"] = rf.run(scenario)


def summary(runs):
    """Print how each run ended, how much was corrected, and how well the formation was kept."""
    for name, run in runs.items():
        totals = run.totals
        print(f"{name:28} {run.outcome}: corrected {100 * totals['correction_m']:4.1f} cm, "
              f"formation error {1000 * totals['formation_error_rmse_m']:4.1f} mm")  # fmt: skip


summary(runs)

# %% [markdown]
# The formation error grows with the furrows, although hardly anything is corrected. The track leads along the furrows,
# so the two robots stand on slopes of different steepness all the way, tilted against each other. A camera that is
# tilted sees the marker in another place, and the follower takes that for a place in the formation. With furrows of 16
# mm and more the robots slide off the plate: try it, `outcome` says so.

# %%
errors_m = {name: run.totals["formation_error_rmse_m"] for name, run in runs.items()}
assert errors_m["furrows of 4 mm"] < errors_m["furrows of 8 mm"] < errors_m["furrows of 12 mm"]

# %% [markdown]
# ## A robot
#
# The robots are parameters of the node `world`, which stands for reality. Some of them:

# %%
for name in ("wheels.radius_m", "chassis.mass_kg", "traction.friction", "imperfections.stop_common_m"):
    print(f"world.{name} = {base.parameters[f'world.{name}']}")

# %% [markdown]
# Change them, and **reality** changes, but not what the robots believe of themselves: the node `drive` still turns a
# distance into wheel rotations by the curves that were calibrated on the usual wheels. That is the interesting case.
# Two kinds of trouble:
#
# - wheels that are 5 % larger than the drive thinks: every move goes 5 % too far, always;
# - motors that stop some 5 mm early or late at random, instead of some 1.5 mm.
#
# Each is run with the predictor that repeats the last displacement, and with `formation`.

# %%
robots = {
    "as it comes": {},
    "larger wheels": {"world.wheels.radius_m": 1.05 * base.parameters["world.wheels.radius_m"]},
    "scattering stops": {"world.imperfections.stop_common_m": 0.005},
}
tried = {
    (name, predictor): rf.run(base.changed(predictor=predictor, settings=settings))
    for name, settings in robots.items()
    for predictor in ("previous", "formation")
}
summary({f"{name}, {predictor}": run for (name, predictor), run in tried.items()})

# %% [markdown]
# An error that is **always the same** can be learned: with larger wheels `formation` asks for less than the robot has
# to go, and hardly more is left to correct than with the usual ones. That is the *actuation bias*, the difference
# between what was commanded and what came.

# %%
larger = tried["larger wheels", "formation"].followers["follower_1"]
print("asked for", np.round(100 * larger.predicted[1:, 1], 1), "cm")
print("went     ", np.round(100 * larger.moved[1:, 1], 1), "cm")

assert np.mean(larger.predicted[1:, 1] - larger.moved[1:, 1]) < -0.002
assert (
    tried["larger wheels", "formation"].totals["correction_m"]
    < 0.5 * tried["larger wheels", "previous"].totals["correction_m"]
)

# %% [markdown]
# **Scatter** can't be learned: what is different each time has to be seen and corrected each time. With this seed
# `formation` even corrects more than `previous` does, and keeps the formation better.

# %%
assert (
    tried["scattering stops", "formation"].totals["correction_m"]
    > 2 * tried["as it comes", "formation"].totals["correction_m"]
)

# %% [markdown]
# This is one seed and twelve timesteps. To compare robots in earnest, run many seeds:
#
# ```
# formation sweep --tracks two --set world.wheels.radius_m=0.0315 --seeds 0:50
# ```
#
# ## Keep it in a file
#
# A scenario is saved as YAML: what differs from the defaults, no more. The command line takes it too.

# %%
clumsy = base.changed(settings=robots["larger wheels"] | robots["scattering stops"])
path = clumsy.save("clumsy.yaml")
print(path.read_text())
assert rf.load_scenario(path).settings == clumsy.settings

# %% [markdown]
# ## Where to go on
#
# - All parameters of the world: [world](../reference/nodes/world.md#parameters); what the model assumes and where the
#   figures come from: [World model](../explanation/world.md)
# - Robots that know their own wheels: [Calibrate motors](../how-to/calibrate_motors.md)
# - Surfaces in a package of your own: [How to add a surface](../how-to/extend.md)
