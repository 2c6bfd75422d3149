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
# # A predictor of your own in 20 lines
#
# A predictor needs two methods: `observe(displacement)` is shown what the follower has just moved, an array of u and v
# in metres and of the turn in radians; `forecast()` returns what it will have to move next. This notebook writes one,
# checks it, and drives with it.

# %%
import matplotlib.pyplot as plt
import numpy as np

import robot_formation as rf
from robot_formation.testing import check_predictor

# %% [markdown]
# ## The idea
#
# Leaders that go round in circles or weave repeat themselves. So fit a mean and **one wave** to all displacements so
# far, try every period from 4 to 40 timesteps, keep the one that fits best, and continue it. That is nonsense for a
# leader that goes straight. So keep the usual forecast too, the last displacement, and believe **whichever has erred
# less** lately.


# %%
class Wave:
    """The last displacement, or the wave that fits all of them best; whichever has erred less."""

    def __init__(self):
        self.seen, self.forecasts, self.errors = [], None, np.zeros(2)

    def observe(self, displacement):
        if self.forecasts is not None:
            self.errors = 0.9 * self.errors + ((self.forecasts - displacement) ** 2).sum(axis=1)
        self.seen.append(displacement)
        self.forecasts = np.stack([displacement, self.continued(np.array(self.seen))])

    def continued(self, seen, ridge=0.02):
        fits = []
        for period in range(4, 41):
            angle = 2 * np.pi * np.arange(len(seen) + 1) / period
            waves = np.stack([np.ones_like(angle), np.cos(angle), np.sin(angle)], axis=1)
            weights = np.linalg.solve(waves[:-1].T @ waves[:-1] + ridge * np.eye(3), waves[:-1].T @ seen)
            fits.append((((waves[:-1] @ weights - seen) ** 2).sum(), *(waves[-1] @ weights)))
        return min(fits)[1:]

    def forecast(self):
        return self.forecasts[self.errors.argmin()]


# %% [markdown]
# The `ridge` keeps the fit apart from nonsense while there are fewer rows than unknowns. `0.9` makes errors of ten
# timesteps ago count a third.
#
# ## Check it
#
# `check_predictor` shows it straight, turning and noisy displacements and looks whether its forecasts are finite, the
# same for the same displacements, and of the right shape. It raises an AssertionError that says what is wrong. Put such
# a call into the tests of your package.

# %%
check_predictor(Wave)

# %% [markdown]
# What it says of a class that is not right:


# %%
class Broken(Wave):
    def forecast(self):
        return [float("nan"), 0.05]


try:
    check_predictor(Broken)
except AssertionError as error:
    print(error)
else:
    raise AssertionError("a forecast that is not finite should have been refused")

# %% [markdown]
# ## Drive with it
#
# A class is named `module:Class`. That of this notebook or script is in the module `__main__`; a class in a file
# `my_module.py` of the working directory is `my_module:Wave`. The leader weaves: 3 cm ahead per timestep, and up to 3
# cm aside with a period of 12 timesteps. `fine_tuner.mode=paper` aligns by the paper's simple rules, as comparisons of
# predictors do; the default, `precise`, also searches by large moves when a forecast was far off.

# %%
weaving = rf.load_scenario("track_two").changed(
    path="slalom",
    surface="saddle",
    seed=1,
    timesteps=30,
    camera="on_demand",
    settings={"leader.path_parameters": ["step_m=0.03"], "fine_tuner.mode": "paper"},
)
mine = "__main__:Wave"
runs = {name: rf.run(weaving.changed(predictor=name)) for name in ("previous", "measured", mine, f"{mine}+close")}
for name, run in runs.items():
    print(f"{name:22} {run.outcome}: {100 * run.totals['correction_m']:5.1f} cm to correct")

# %% [markdown]
# `+close` behind the name adds what the camera says is left over to the next move, and learns how far the robot's moves
# differ from its commands. You get it for nothing, and it is worth a lot: without it a predictor has to forecast what
# it left over itself.

# %%
figure, axes = plt.subplots(2, 1, figsize=(7, 6), sharex=True, sharey=True, layout="constrained")
for panel, name in zip(axes, ("previous", f"{mine}+close"), strict=True):
    rf.plot_corrections(runs[name], panel)
    panel.set_title(name, loc="right")
figure.savefig("your_predictor.png")

corrections = {name: run.totals["correction_m"] for name, run in runs.items()}
assert all(run.outcome == "done" for run in runs.values())
assert corrections[f"{mine}+close"] < 0.8 * corrections["previous"]
assert corrections[f"{mine}+close"] < corrections["measured"]

# %% [markdown]
# ## Where to go on
#
# Write the class into a file `my_module.py`, with `import numpy as np` at its top, and
#
# ```
# formation run --in-process --predictor my_module:Wave+close --path slalom
# formation sweep --predictors previous,my_module:Wave+close --seeds 0:20
# formation score my_module:Wave+close
# ```
#
# The last one drives five courses with seeds that nobody has tuned anything on, and shows your class beside those that
# came before it: [Exercises](exercises.md). What else a predictor may have, and how a package makes it known: [How to
# add a predictor](../how-to/extend.md).
