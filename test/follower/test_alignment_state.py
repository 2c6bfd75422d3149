"""The texts of the topic `alignment` are formatted and parsed in one place."""

import pytest

from robot_formation.follower.alignment_state import AlignmentState, State


@pytest.mark.parametrize("state", AlignmentState)
@pytest.mark.parametrize("reason", ["", "turn", "a reason: with a colon"])
def test_every_text_is_parsed_to_its_state(state: AlignmentState, reason: str) -> None:
    assert AlignmentState.parse(State(state, reason).text) is state


@pytest.mark.parametrize("text", ["", "lostness", "LOST", "corrected: u", ": lost", "__members__"])
def test_other_texts_are_no_state(text: str) -> None:
    assert AlignmentState.parse(text) is None


def test_each_move_of_a_timestep_goes_with_a_state() -> None:
    senders = {state.value for state in AlignmentState if state.sends_move}
    assert senders == {"collect", "predict", "correct", "search"}
    assert {state.value for state in AlignmentState if state.begins} == {"align", "collect", "predict"}
