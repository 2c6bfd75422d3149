"""Time, speed, pauses and steps of a playback."""

import pytest

from robot_formation.viewing.playback import Playback

S = 10**9


@pytest.fixture
def playback() -> Playback:
    return Playback(10 * S, 20 * S, [15 * S, 12 * S, 12 * S, 25 * S])


def test_time_passes_at_the_speed_that_is_set_and_not_in_a_pause(playback: Playback) -> None:
    playback.elapse(1.0)
    playback.speed = 4.0
    playback.elapse(0.5)
    assert playback.now_s == pytest.approx(3.0)
    playback.playing = False
    playback.elapse(5.0)
    assert playback.now_s == pytest.approx(3.0)


def test_it_stays_at_the_end_for_a_moment_and_begins_again(playback: Playback) -> None:
    playback.elapse(100.0)
    assert playback.now_s == playback.duration_s == 10.0
    playback.elapse(0.05)
    assert playback.now_s == 0.0


def test_steps_lead_to_the_stops_and_the_end_and_round(playback: Playback) -> None:
    seen = []
    for _ in range(4):
        playback.step()
        seen.append(playback.now_ns // S)
    assert seen == [12, 15, 20, 12]
    assert not playback.playing


def test_seeking_pauses_inside_the_run(playback: Playback) -> None:
    for wanted, got in ((4.0, 14), (-3.0, 10), (99.0, 20)):
        playback.seek(wanted)
        assert playback.now_ns == got * S
    assert not playback.playing


def test_a_run_without_a_duration_has_one_instant() -> None:
    playback = Playback(5, 5, [])
    playback.elapse(1.0)
    playback.step()
    assert playback.now_ns == 5
