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
# # Your displacements through every predictor
#
# A predictor knows nothing of robots: it is shown one displacement after the other and says what the next one will be.
# So you can try all of them on a log of your own, a table with one row per timestep. This notebook makes such a table,
# reads it, and asks every predictor for every row before it is shown.

# %%
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

import robot_formation as rf

# %% [markdown]
# ## A log
#
# If you have a log, put its name here and leave out the rest of this cell. Else here is one: a robot that goes 5 cm
# ahead per timestep and weaves from side to side with a period of 12 timesteps; its wheels measure with an error of 1.5
# mm. Displacements are in the robot's own frame at the timestep's start, in metres: **u** to the right, **v** ahead.

# %%
log_file = Path("my_log.csv")

t = np.arange(48)
weaving = np.column_stack([0.02 * np.cos(2 * np.pi * t / 12), np.full(t.size, 0.05)])
measured = weaving + np.random.default_rng(7).normal(0.0, 0.0015, weaving.shape)
pd.DataFrame(measured, columns=["u_m", "v_m"]).to_csv(log_file, index=False, float_format="%.5f")
print(log_file.read_text()[:70])

# %% [markdown]
# Only the array matters, so the log may come from anywhere. Check the units: a predictor refuses displacements that no
# such robot can do, and millimetres that are taken for metres are among them.

# %%
log = pd.read_csv(log_file)
displacements = log[["u_m", "v_m"]].to_numpy()
print(displacements.shape)

try:
    rf.forecast("previous", 1000 * displacements)
except rf.FormationError as error:
    print("refused:", error)
else:
    raise AssertionError("millimetres should have been refused")

# %% [markdown]
# ## One predictor
#
# `forecast` shows the rows one by one. `means` holds the forecast of each row from the rows before it; the first row
# has none.

# %%
found = rf.forecast("formation", displacements)
print(found)
print(found.means[:3])

assert found.means.shape == displacements.shape
assert np.isnan(found.means[0]).all()
errors_mm = 1000 * np.linalg.norm(found.means[1:] - displacements[1:], axis=1)
assert np.isclose(np.sqrt(np.mean(errors_mm**2)), 1000 * found.errors["rmse"])

# %% [markdown]
# ## All of them
#
# `rmse` is the root mean square of the forecasts' errors. The second number leaves out the first 24 timesteps, two
# periods, in which nobody can know the period yet. Names that end with `+close` add what a camera says is left over;
# this log has no camera, so they are left out here.

# %%
names = [name for name in rf.predictors() if not name.endswith("+close")]
forecasts = {name: rf.forecast(name, displacements) for name in names}


def late_mm(found):
    """Root mean square error from timestep 25 on, millimetres."""
    return 1000 * np.sqrt(np.mean(np.sum((found.means[24:] - displacements[24:]) ** 2, axis=1)))


table = pd.DataFrame(
    {"all (mm)": {n: 1000 * f.errors["rmse"] for n, f in forecasts.items()},
     "from timestep 25 on (mm)": {n: late_mm(f) for n, f in forecasts.items()}}
).sort_values("from timestep 25 on (mm)")  # fmt: skip
print(table.round(1))

# %% [markdown]
# How to read it:
#
# - `previous` repeats the last displacement. That is the mark to beat; a predictor above it costs more than it gains.
# - `ewma`, an average of the latest displacements, is worse than that here: it lags behind.
# - `measured`, the paper's online DMD, fits a matrix to pairs of consecutive displacements. A single displacement does
#   not say whether the robot is swinging to the right or back, so no such matrix can forecast it ([Why
#   delays](why_delays.py)).
# - `formation` mixes several models, Koopman oscillators and delays among them. It finds the period, and what is left
#   is little more than the noise: 1.5 mm in each of two axes are 2.1 mm, which nobody can forecast.

# %%
late = table["from timestep 25 on (mm)"]
assert late["ewma"] > late["previous"]
assert late.idxmin() == "formation"
assert late["formation"] < 0.5 * late["previous"]

# %% [markdown]
# ## A picture
#
# u, which swings, with the forecasts of three predictors.

# %%
figure, axes = plt.subplots(figsize=(8, 3.5), layout="constrained")
axes.plot(t + 1, 100 * displacements[:, 0], "o", color="0.5", label="came")
for name in ("previous", "measured", "formation"):
    axes.plot(t + 1, 100 * forecasts[name].means[:, 0], label=name)
axes.set(xlabel="timestep", ylabel="u (cm)")
axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
figure.savefig("your_displacements.png")

# %% [markdown]
# ## Further ahead
#
# With a horizon, a predictor also says what comes after the last row, and how sure it is. Here the next 12 timesteps,
# one period, beside what the robot would have done without noise.

# %%
found = rf.forecast("formation", displacements, horizon=12)
to_come = 0.02 * np.cos(2 * np.pi * (t[-1] + 1 + np.arange(12)) / 12)
deviations = np.sqrt(found.ahead_covariances[:, 0, 0])
for h, (forecast, deviation, truth) in enumerate(zip(found.ahead[:, 0], deviations, to_come, strict=True), 1):
    print(f"{h:2d} timesteps ahead: u {100 * forecast:5.2f} +- {100 * deviation:.2f} cm, true {100 * truth:5.2f} cm")

assert np.abs(found.ahead[:, 0] - to_come).max() < 0.01

# %% [markdown]
# ## Where to go on
#
# - The same on the command line, with columns of other names and units: [Predictors on a log](../how-to/predict.md)
# - [A predictor of your own in 20 lines](your_predictor.py)
