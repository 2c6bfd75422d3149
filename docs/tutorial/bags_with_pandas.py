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
# # Reading bags with pandas
#
# A run can be recorded into a **bag**: a folder with an MCAP file that holds every message of every topic, with its
# simulated time. `ros2 bag`, Foxglove and others read it too. This notebook records a short run and reads it in two
# ways: the finished analysis, and the messages themselves. Neither needs ROS.

# %%
from pathlib import Path
from tempfile import mkdtemp

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from rosbags.highlevel import AnyReader

import robot_formation as rf

# %% [markdown]
# ## A bag
#
# If you have one, put its folder here and leave out the rest of this cell. A bag is never overwritten, so this one gets
# a new folder each time.

# %%
bag = Path(mkdtemp(prefix="my_run_", dir=".")) / "my_bag"
rf.run(rf.load_scenario("track_two").changed(seed=3, timesteps=8, camera="on_demand"), bag=bag)
print(sorted(file.name for file in bag.iterdir()))

# %% [markdown]
# ## The analysis
#
# `analyze` reads the bag and computes what `formation analyze` prints. `to_pandas` gives a row per follower and
# timestep. Lengths are in metres, angles in radians, and every column says so.

# %%
run = rf.analyze(bag)
table = run.to_pandas()
print(run)
print(table.columns.tolist())
print((100 * table[["predicted_v_m", "moved_v_m", "correction_v_m", "formation_error_m"]]).round(2))

# %% [markdown]
# From here on it is pandas. How far was the forecast along v from what the follower moved, over all timesteps from 4
# on?

# %%
late = table[table["t"] >= 4]
off_m = late["moved_v_m"] - late["predicted_v_m"]
print((1000 * off_m).describe().round(1))
print(f"correction distance: {100 * (late['correction_u_m'] + late['correction_v_m']).sum():.2f} cm")

assert len(table) == 8
assert table["predicted_v_m"].isna().tolist() == [True] + 7 * [False]
assert np.isclose((late["correction_u_m"] + late["correction_v_m"]).sum(), run.totals["correction_m"])

# %% [markdown]
# ## The messages
#
# What the analysis doesn't answer is in the messages. The library `rosbags` reads them: message definitions are in the
# bag itself. First, which topics there are.

# %%
with AnyReader([bag]) as reader:
    topics = pd.DataFrame(
        [(found.topic, found.msgtype, found.msgcount) for found in reader.connections],
        columns=["topic", "type", "messages"],
    ).sort_values("messages", ascending=False)
print(topics.head(12).to_string(index=False))
assert {"/follower_1/displacement", "/leader/moved", "/ground_truth/leader/odom"} <= set(topics["topic"])

# %% [markdown]
# A topic becomes a table by a function that picks the fields of a message. Times are nanoseconds of simulated time.


# %%
def topic_table(bag, topic, fields):
    """A row per message of a topic: its time in seconds, and what `fields(message)` returns, a dictionary."""
    with AnyReader([bag]) as reader:
        chosen = [found for found in reader.connections if found.topic == topic]
        rows = [
            {"time_s": stamp_ns * 1e-9, **fields(reader.deserialize(data, connection.msgtype))}
            for connection, stamp_ns, data in reader.messages(connections=chosen)
        ]
    return pd.DataFrame(rows)


# %% [markdown]
# ### Every single move
#
# `moved` tells each move by the follower's encoder wheels, prediction moves and corrections alike. ROS has x forward
# and y to the left, so v is x and u is -y.


# %%
def displacement(message):
    """u and v, metres."""
    return {"u_m": -message.pose.pose.position.y, "v_m": message.pose.pose.position.x}


moves = topic_table(bag, "/follower_1/moved", displacement)
print(moves.round(4).to_string(index=False))

# %% [markdown]
# Which timestep does a move belong to? A timestep begins with the leader's move, so it is that of the leader's latest
# move before it: `merge_asof` finds it. Moves before the leader's first one belong to none: the follower lined up. The
# moves of a timestep add up to its `displacement`, but for turns of about a degree.

# %%
leader = topic_table(bag, "/leader/moved", displacement)
begins = leader[["time_s"]].assign(t=range(1, len(leader) + 1))
moves = pd.merge_asof(moves, begins, on="time_s")
sums = moves.groupby("t")[["u_m", "v_m"]].sum()
displacements = topic_table(bag, "/follower_1/displacement", displacement)
print((100 * sums).round(2))
print(f"{moves['t'].isna().sum()} moves before the leader's first one")

assert len(sums) == len(displacements) == 8
assert np.allclose(sums.to_numpy(), displacements[["u_m", "v_m"]].to_numpy(), atol=0.003)

# %% [markdown]
# ### Where the robots truly were
#
# Ground truth, which only a simulation has.


# %%
def place(message):
    """x and y in the world, metres."""
    return {"x_m": message.pose.pose.position.x, "y_m": message.pose.pose.position.y}


truth = {robot: topic_table(bag, f"/ground_truth/{robot}/odom", place) for robot in ("leader", "follower_1")}
both = pd.merge_asof(truth["follower_1"], truth["leader"], on="time_s", suffixes=("", "_leader"))
distance_m = np.hypot(both["x_m"] - both["x_m_leader"], both["y_m"] - both["y_m_leader"])

figure, axes = plt.subplots(figsize=(8, 3.2), layout="constrained")
axes.plot(both["time_s"], 100 * distance_m, label="distance of the two robots")
axes.plot(both["time_s"], np.full(len(both), 32.0), "k--", linewidth=0.8, label="in formation")
axes.set(xlabel="simulated time (s)", ylabel="distance (cm)")
axes.legend()
figure.savefig("distance.png")

# %% [markdown]
# It swings once per timestep: the leader moves first, the follower after it. At the ends of the timesteps it is near 32
# cm.

# %%
at_ends = pd.merge_asof(displacements[["time_s"]], both.assign(distance_m=distance_m), on="time_s")
print((100 * at_ends["distance_m"]).round(1).tolist())
assert (at_ends["distance_m"] - 0.32).abs().max() < 0.02
assert distance_m.max() > 0.322

# %% [markdown]
# ## Where to go on
#
# - What is on which topic: the [nodes](../reference/nodes/common.md); more about bags: [Bags](../../bags/README.md)
# - Two bags side by side: [Compare runs](../how-to/compare_and_report.md)
