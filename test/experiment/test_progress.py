"""The lines of progress say what the analysis says later, in whatever order the topics bring their messages."""

import random
import re
from collections import defaultdict
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import pytest

from graph_tools import short_scenario
from repository import ROOT
from robot_formation import conversions, names
from robot_formation.analysis.from_bag import load_run
from robot_formation.analysis.quantities import analyse
from robot_formation.bag.reader import read_bag
from robot_formation.experiment import progress as progress_lines
from robot_formation.experiment.in_process import run_in_process
from robot_formation.experiment.progress import Progress
from robot_formation.geometry.slots import slot

pytestmark = [pytest.mark.slow, pytest.mark.xdist_group("progress")]

LINE = re.compile(
    r"(?:(?P<robot>follower_\d)  )?timestep +(?P<t>\d+)/(?P<n>\d+)  correction +(?P<correction>[\d.]+) cm  "
    r"formation error +(?P<error>[\d.]+) cm  +[\d.]+ s"
)
SAMPLES = ("track_one_formation", "track_one_previous", "track_two_measured")


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Bags of runs by name: samples of one follower, and a new one of two."""
    bag = tmp_path_factory.mktemp("progress") / "two_followers"
    result = run_in_process(short_scenario("followers=2", track="one"), bag, {"timesteps": "4"})
    assert result.exit_code == 0
    return {bag.name: bag, **{name: ROOT / "bags" / "samples" / name for name in SAMPLES}}


def messages_of(bag: Path, progress: Progress) -> dict[str, list[Any]]:
    """The messages that are followed, by topic, in the order in which they were sent."""
    found = defaultdict(list)
    with read_bag(bag) as opened:
        for message in opened.raw_messages(progress.topics):
            found[message.topic].append(conversions.from_cdr(message.cdr, opened.topics[message.topic]))
    return found


def table_of(bag: Path) -> dict[tuple[str, int], tuple[str, str]]:
    """What the analysis says: (robot, t) to correction and formation error, both as a line shows them."""
    analysis = analyse(load_run(bag))
    found = {}
    for follower in analysis.followers:
        for row in follower.timesteps:
            assert row.formation_error_m is not None
            correction_m = row.corrections.u_m + row.corrections.v_m
            found[follower.name, row.t] = (f"{correction_m * 100:.1f}", f"{row.formation_error_m * 100:.2f}")
    return found


def told(
    messages: dict[str, list[Any]], followers: int, timesteps: int, order: Sequence[str]
) -> list[tuple[tuple[str, int], tuple[str, str]]]:
    """The lines, parsed, when topics give their next messages in a given order."""
    lines: list[str] = []
    progress = Progress([slot(0.32)] * followers, timesteps, lines.append, lambda: 0.0)
    queues = {topic: iter(group) for topic, group in messages.items()}
    for topic in order:
        progress.listen(topic, next(queues[topic]))
    assert progress.complete
    matches = [match for line in lines if (match := LINE.fullmatch(line))]
    assert len(matches) == len(lines)
    assert {match["n"] for match in matches} == {str(timesteps)}
    rows = [
        ((match["robot"] or "follower_1", int(match["t"])), (match["correction"], match["error"])) for match in matches
    ]
    assert len(rows) == followers * timesteps
    return rows


def held_back(topics: Iterable[str], order: Sequence[str], late: str, count: int) -> list[str]:
    """An order in which a topic's messages always come so many messages later."""
    result, waiting = [], []
    for topic in order:
        result.append(None if topic == late else topic)
        if topic == late:
            waiting.append(len(result) + count)
        while waiting and waiting[0] <= len(result):
            waiting.pop(0)
            result.append(late)
    return [topic for topic in result if topic] + [late] * len(waiting)


@pytest.mark.parametrize("name", ["two_followers", *SAMPLES])
def test_every_line_says_what_the_table_says_in_any_order_of_the_topics(
    runs: dict[str, Path], name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(progress_lines, "_FORGOTTEN_AT_ONCE", 0)  # forget as early as can be
    bag = runs[name]
    expected = table_of(bag)
    followers, timesteps = len({robot for robot, _ in expected}), max(t for _, t in expected)
    progress = Progress([slot(0.32)] * followers, timesteps, lambda text: None, lambda: 0.0)
    messages = messages_of(bag, progress)
    assert set(messages) == set(progress.topics)
    with read_bag(bag) as opened:
        sent = [message.topic for message in opened.raw_messages(progress.topics)]
    orders = [sent]
    for topic in progress.topics:
        orders += [held_back(progress.topics, sent, topic, count) for count in (1, 2, 7)]
        orders.append([other for other in sent if other != topic] + [topic] * sent.count(topic))
    shuffler = random.Random(5)
    for _ in range(12):
        # A topic keeps its own order, so shuffling the names gives every mixture of the topics.
        orders.append(shuffler.sample(sent, len(sent)))
    for order in orders:
        assert sorted(order) == sorted(sent)
        assert dict(told(messages, followers, timesteps, order)) == expected


def test_the_timesteps_of_a_follower_are_told_in_order(runs: dict[str, Path]) -> None:
    bag = runs["track_one_previous"]
    messages = messages_of(bag, Progress([slot(0.32)], 15, print, lambda: 0.0))
    order = [topic for topic, group in messages.items() for _ in group]
    assert [t for (_, t), _ in told(messages, 1, 15, order)] == list(range(1, 16))


def test_timesteps_that_were_told_are_forgotten(runs: dict[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress_lines, "_FORGOTTEN_AT_ONCE", 0)
    progress = Progress([slot(0.32)], 15, lambda text: None, lambda: 0.0)
    most = 0
    with read_bag(runs["track_one_previous"]) as opened:
        for message in opened.raw_messages(progress.topics):
            progress.listen(message.topic, conversions.from_cdr(message.cdr, opened.topics[message.topic]))
            heard = progress._heard.values()
            most = max(most, *(len(e.kept) for h in heard for e in (h.poses, h.moves, h.timesteps)))
    assert progress.complete
    heard_poses = max(len(heard.poses) for heard in progress._heard.values())
    assert most < 20 < 40 < heard_poses  # those of three timesteps


def test_a_move_that_could_not_be_measured_does_not_silence_the_run(runs: dict[str, Path]) -> None:
    bag = runs["track_one_previous"]
    progress = Progress([slot(0.32)], 15, print, lambda: 0.0)
    messages = messages_of(bag, progress)
    moved = f"/follower_1/{names.MOVED.name}"
    first = conversions.stamp_of(messages[f"/{names.LEADER}/{names.MOVED.name}"][0])
    index = next(i for i, message in enumerate(messages[moved]) if conversions.stamp_of(message) > first)
    unmeasured = conversions.from_cdr(conversions.to_cdr(messages[moved][index]), names.MOVED.type)
    unmeasured.pose.pose.position.x = float("nan")
    messages[moved].insert(index + 1, unmeasured)
    order = [topic for topic, group in messages.items() for _ in group]
    assert dict(told(messages, 1, 15, order)) == table_of(bag)


def test_a_reminder_says_where_each_follower_is() -> None:
    lines: list[str] = []
    progress = Progress([slot(0.32)], 15, lines.append, lambda: 3.0)
    progress.remind()
    for state in ("predict", "correct: far"):
        progress.listen(f"/follower_1/{names.ALIGNMENT.name}", conversions.string(state))
    progress.remind()
    assert lines == [
        "follower_1 is in timestep 0/15     3.0 s",
        "follower_1 is in timestep 1/15 (correct: far)     3.0 s",
    ]
