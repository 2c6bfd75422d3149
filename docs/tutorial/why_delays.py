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
# # Why delays
#
# A leader that speeds up and slows down periodically is easy to predict: after one period you have seen it all. Yet a
# predictor that looks at the last displacement alone can't do it, whatever it learns. This notebook shows why, and how
# a few past displacements more (*delays*) mend it.

# %%
import matplotlib.pyplot as plt
import numpy as np

import robot_formation as rf
from robot_formation.koopman import EDMD, Constant, DelayEmbedding, Identity

# %% [markdown]
# ## An oscillation, seen in part
#
# The leader moves v(t) = 5 cm + 2 cm cos(2 pi t / 12) in timestep t. Its **state** is two things: how fast it is, and
# whether it is speeding up or slowing down. We observe the first one only. The library wants snapshots as columns.

# %%
period = 12
t = np.arange(61)
v = 0.05 + 0.02 * np.cos(2 * np.pi * t / period)
trajectory = v[np.newaxis, :]
print(trajectory.shape)

# %% [markdown]
# Draw each displacement against the one before it. If the last displacement determined the next one, this would be the
# graph of a function. It is an ellipse: above nearly every value there are **two** points, one from speeding up and one
# from slowing down.

# %%
figure, axes = plt.subplots(figsize=(5, 5), layout="constrained")
axes.plot(100 * v[:-1], 100 * v[1:], "o", label="v(t+1) over v(t)")
axes.set(xlabel="v(t) (cm)", ylabel="v(t+1) (cm)", aspect="equal")

# %% [markdown]
# ## The best linear map of the displacement alone
#
# EDMD fits the matrix K for which K psi(x_t) is nearest to psi(x_t+1), psi being a dictionary of functions of the
# state. With psi(v) = (1, v) that is the straight line that fits the ellipse best.

# %%
alone = EDMD.fit(Constant(1) + Identity(1), trajectory[:, :-1], trajectory[:, 1:])
line = np.array([0.03, 0.07])
axes.plot(100 * line, [100 * alone.predict([[value]], 1)[0, 0] for value in line], "k-", label="best line")
axes.legend()
figure.savefig("ellipse.png")

print("eigenvalues of K:", np.round(alone.eigenvalues, 3))
print(f"one step ahead, root mean square error: {1000 * alone.training_errors.state:.1f} mm")

assert np.abs(alone.eigenvalues.imag).max() < 1e-12
assert alone.training_errors.state > 0.006

# %% [markdown]
# Both eigenvalues are real. One is 1: it belongs to the constant. The other is cos(2 pi / 12) = 0.866, so the model
# says that every deviation from the mean decays. A K of this size **can't oscillate**: an oscillation needs a pair of
# conjugate complex eigenvalues, and one number beside the constant has room for a single real one. The error of 7 mm is
# sin(2 pi / 12) times the root mean square of the deviation, 14 mm.
#
# More data don't help, and neither do more functions of v: above one v there are two successors, and no function of v
# is right on both.

# %%
assert np.isclose(min(alone.eigenvalues.real), np.cos(2 * np.pi / period), atol=0.02)
assert np.isclose(alone.training_errors.state, np.sin(2 * np.pi / period) * np.std(v[:-1]), rtol=0.05)

# %% [markdown]
# ## One delay
#
# Now show K the last **two** displacements, psi = (1, v(t), v(t-1)). Their difference tells speeding up from slowing
# down. For a wave there even is an exact formula, v(t+1) - m = 2 cos(2 pi / 12) (v(t) - m) - (v(t-1) - m), with the
# mean m, and EDMD finds it.

# %%
delayed = EDMD.fit(Constant(1) + DelayEmbedding(1, 1), trajectory[:, :-1], trajectory[:, 1:])
found = 2 * np.pi / np.abs(np.angle(delayed.eigenvalues)).max()
print("eigenvalues of K:", np.round(delayed.eigenvalues, 3))
print("their moduli:    ", np.round(np.abs(delayed.eigenvalues), 6))
print(f"period: {found:.3f} timesteps, one step ahead: {1000 * delayed.training_errors.state:.1e} mm")

assert np.isclose(found, period)
assert np.allclose(np.abs(delayed.eigenvalues), 1.0)
assert delayed.training_errors.state < 1e-12

# %% [markdown]
# The pair exp(+-i 2 pi / 12) lies on the unit circle: it neither grows nor decays, and its angle is the period. The
# forecast is right over any number of timesteps. Here is half a period ahead, from the same place:

# %%
start = 20
ahead = 12
figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
axes[0].plot(t[start - 8 : start + ahead + 1], 100 * v[start - 8 : start + ahead + 1], "o", color="0.6", label="leader")
for model, name in ((alone, "v(t) alone"), (delayed, "with one delay")):
    window = trajectory[:, start - model.dictionary.history : start + 1]
    forecast = model.predict(window, ahead)[0]
    axes[0].plot(t[start + 1 : start + ahead + 1], 100 * forecast, label=name)
    axes[1].plot(model.eigenvalues.real, model.eigenvalues.imag, "o", label=name)
axes[0].set(xlabel="timestep", ylabel="displacement (cm)")
circle = np.exp(1j * np.linspace(0, 2 * np.pi, 200))
axes[1].plot(circle.real, circle.imag, "k-", linewidth=0.5)
axes[1].set(xlabel="real part", ylabel="imaginary part", title="eigenvalues of K", aspect="equal")
axes[0].legend()
axes[1].legend(loc="center left")
figure.savefig("forecasts.png")

# %% [markdown]
# ## Noise asks for more delays
#
# Real displacements are noisy, here with a standard deviation of 2 mm. A wave needs two numbers, and with noise in both
# of them least squares finds eigenvalues **inside** the circle: it takes part of the oscillation for noise. More delays
# average the noise out, and the eigenvalues go to the circle. But each delay is one more column of K to learn.

# %%
noise = np.random.default_rng(1)
noisy = trajectory + noise.normal(0.0, 0.002, trajectory.shape)
new = trajectory + noise.normal(0.0, 0.002, trajectory.shape)
moduli, errors_m = {}, {}
for delays in (1, 2, 3, 4, 6, 9):
    model = EDMD.fit(Constant(1) + DelayEmbedding(1, delays), noisy[:, :-1], noisy[:, 1:])
    wave = model.eigenvalues[np.abs(model.eigenvalues - np.exp(2j * np.pi / period)).argmin()]
    moduli[delays] = abs(wave)
    errors_m[delays] = model.errors(new[:, :-1], new[:, 1:]).state
    print(f"{delays} delays: modulus {moduli[delays]:.3f}, error on new data {1000 * errors_m[delays]:.1f} mm")

assert moduli[1] < 0.96
assert abs(moduli[6] - 1.0) < 0.01
assert errors_m[6] < 0.7 * errors_m[1]

# %% [markdown]
# ## On the robots
#
# The predictor `edmd` learns K online, from the follower's own displacements, with a dictionary of your choice;
# `+close` adds what the camera says is left over to the next move. The leader's path `pulse` is the oscillation from
# above. The only difference between the two runs is the dictionary.

# %%
pulse = rf.load_scenario("track_two").changed(
    path="pulse",
    camera="on_demand",
    timesteps=36,
    predictor="edmd+close",
    settings={"leader.path_parameters": ["step_m=0.03"], "predictor.edmd.prior": 1.0},
)
dictionaries = {"displacement alone": "constant identity", "six delays": "constant identity delay:6"}
runs = {
    name: rf.run(pulse.changed(settings={"predictor.edmd.dictionary": text})) for name, text in dictionaries.items()
}
figure, axes = plt.subplots(2, 1, figsize=(7, 6), sharex=True, sharey=True, layout="constrained")
for panel, (name, run) in zip(axes, runs.items(), strict=True):
    rf.plot_corrections(run, panel)
    panel.set_title(name, loc="right")
    print(f"{name}: {100 * run.totals['correction_m']:.1f} cm to correct")
figure.savefig("corrections.png")

assert runs["six delays"].totals["correction_m"] < 0.6 * runs["displacement alone"].totals["correction_m"]

# %% [markdown]
# The first period is about the same: nobody can know an oscillation that has not been seen yet. After that, delays pay.
#
# ## Where to go on
#
# - [A predictor of your own in 20 lines](your_predictor.py), another way to use a period
# - Theory, and Koopman oscillators, which need one period less: [Koopman operators from
#   data](../explanation/koopman.md)
# - Where delays gain nothing: [Predictors compared](../explanation/predictors_compared.md)
