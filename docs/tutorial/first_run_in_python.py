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
# # A first run, and what it means
#
# A **leader** drives over a bowl, 5 cm per **timestep**. A **follower** keeps its place 32 cm to the leader's right. It
# gets no data from the leader: it has a camera that sees a coloured marker on the leader, and wheels that measure its
# own motion. This notebook runs that in simulation, reads the result, and changes one thing.

# %%
import matplotlib.pyplot as plt
import numpy as np

import robot_formation as rf

# %% [markdown]
# ## Run a scenario
#
# A **scenario** is everything that a run needs to be repeated: track, robots, predictor, and the seed of all random
# numbers. `load_scenario` takes the name of one that comes with the package (`rf.scenarios()` lists them) or a YAML
# file. A scenario never changes; `changed` makes another one. `camera="on_demand"` makes pictures only when the
# follower waits for one, which is faster.

# %%
scenario = rf.load_scenario("track_two").changed(seed=3, camera="on_demand")
run = rf.run(scenario)
print(scenario)
print(run)

# %% [markdown]
# ## What happens in a timestep
#
# 1. The leader moves 5 cm ahead.
# 2. The follower makes its **prediction move**: as far as its **predictor** expects that it has to go. The predictor
#    knows only the follower's own past displacements and what its camera saw after them.
# 3. The follower looks, and makes **corrections** until the leader is where it belongs in the picture.
#
# The table has one row per timestep. **u** is to the follower's right, **v** ahead.

# %%
print(run.summary())

# %% [markdown]
# The columns, from left to right: what the predictor asked for; how far the follower went in the whole timestep; how
# much of that were corrections; what the camera says is left at the end (the **residual**); the number of correcting
# moves; the **formation error**, which is the true distance from the place in formation and which only the simulation
# knows; and how far the follower is turned against the leader.
#
# ## The same as arrays
#
# Everything is also there as NumPy arrays with a row per timestep: metres and radians, u and v in this order, NaN where
# nothing is known. In timestep 1 there is no forecast yet.

# %%
follower = run.followers["follower_1"]
print(follower.predicted[:4])
print(follower.moved[:4])

assert run.outcome == "done"
assert follower.moved.shape == (20, 2)
assert np.isnan(follower.predicted[0]).all()
assert np.isfinite(follower.predicted[1:]).all()

# %% [markdown]
# The leader's steps are 5 cm long, but the follower's displacements are not: on a curved surface the two robots stand
# on slopes of different steepness, wheels slip downhill, and motors overshoot a little. That is what the follower has
# to learn, and no formula tells it.

# %%
print("leader   ", np.round(100 * run.leader.moved[:, 1], 1), "cm ahead")
print("follower ", np.round(100 * follower.moved[:, 1], 1), "cm ahead")

# %% [markdown]
# ## Two numbers that sum it up
#
# The **correction distance** adds up all corrections along u and v from timestep 4 on: in the first three timesteps the
# predictor only collects data. The better the predictions, the smaller it is. The **formation error**, as a root mean
# square over the timesteps, says how well the formation was really kept.

# %%
correction_m = follower.corrections[3:].sum()
error_m = np.sqrt((follower.formation_error**2).mean())
print(f"correction distance {100 * correction_m:.2f} cm, formation error {100 * error_m:.2f} cm")

assert np.isclose(correction_m, run.totals["correction_m"])
assert np.isclose(error_m, run.totals["formation_error_rmse_m"])

# %% [markdown]
# ## Figures
#
# The standard figures are drawn on axes of yours.

# %%
figure, axes = plt.subplots(figsize=(6, 6), layout="constrained")
rf.plot_trajectory(run, axes)
figure.savefig("trajectory.png")

# %% [markdown]
# ## Change one thing
#
# The run above used the predictor `formation`, the default. `measured` is online dynamic mode decomposition, the method
# of the paper that this package is built after. Same seed, same start, same noise; only the predictor differs.

# %%
other = rf.run(scenario.changed(predictor="measured"))

figure, axes = plt.subplots(2, 1, figsize=(7, 6), sharex=True, sharey=True, layout="constrained")
rf.plot_corrections(run, axes[0])
rf.plot_corrections(other, axes[1])
axes[0].set_title("predictor formation", loc="right")
axes[1].set_title("predictor measured", loc="right")
figure.savefig("corrections.png")

print(run)
print(other)
assert other.totals["correction_m"] > 2 * run.totals["correction_m"]

# %% [markdown]
# `measured` has to be corrected far more. Why? It forecasts the whole displacement of a timestep, in which everything
# is mixed: what the leader did, what was left over before, and how far the robot slid past its command. `formation`
# keeps these apart: what the camera says is left is known, so it need not be predicted, only added to the next move.
#
# **One seed is an anecdote.** Before you believe a difference, run several. Here are three, with half of the timesteps
# so that it doesn't take long; with `jobs=2` two runs go on at the same time.

# %%
sweep = rf.sweep(scenario.changed(timesteps=10), predictors=["formation", "measured"], seeds=range(3))
table = sweep.to_pandas()[["predictor", "seed", "outcome", "correction_m", "formation_error_rmse_m"]]
print(table)
assert len(table) == 6

# %% [markdown]
# ## Where to go on
#
# - [Your displacements through every predictor](your_displacements.py)
# - [A predictor of your own in 20 lines](your_predictor.py)
# - What the terms mean: [Glossary](../reference/glossary.md)
# - Why one predictor corrects less than another: [Predictors compared](../explanation/predictors_compared.md)
