"""Topics are chosen by name, by regular expression, or all but some."""

import pytest

from robot_formation.bag.errors import BagError
from robot_formation.bag.selection import Selection

STRING, IMAGE = "std_msgs/msg/String", "sensor_msgs/msg/Image"


def test_without_a_wish_all_topics_are_meant_but_hidden_ones() -> None:
    everything = Selection()
    assert everything.everything
    assert everything.wants("/words", STRING)
    assert everything.wants("/camera", IMAGE)
    assert not everything.wants("/drive/_action/feedback", STRING)


def test_names_and_a_regular_expression_add_up_and_match_as_a_whole() -> None:
    chosen = Selection(["/words"], regex="/follower_[12]/.*")
    assert chosen.wants("/words", STRING)
    assert chosen.wants("/follower_2/moved", STRING)
    assert not chosen.wants("/words/more", STRING)
    assert not chosen.wants("/the/follower_2/moved", STRING)


def test_what_is_excluded_is_left_out_unless_it_is_named() -> None:
    chosen = Selection(["/b/path"], regex=".*", exclude=".*/path")
    assert chosen.wants("/a/moved", STRING)
    assert not chosen.wants("/a/path", STRING)
    assert chosen.wants("/b/path", STRING)
    assert not Selection(exclude="/a").wants("/a", STRING)


def test_pictures_are_left_out_unless_wanted_or_named() -> None:
    chosen = Selection(["/front"], regex=".*", images=False)
    assert chosen.wants("/front", IMAGE)
    assert not chosen.wants("/rear", IMAGE)
    assert not chosen.wants("/rear", "sensor_msgs/msg/CompressedImage")
    assert Selection(regex=".*").wants("/rear", IMAGE)


@pytest.mark.parametrize("what", ["regex", "exclude"])
def test_a_bad_regular_expression_is_told_in_one_line(what: str) -> None:
    with pytest.raises(BagError, match=rf"'\*a' for '{what}' is no regular expression") as caught:
        Selection(regex="*a") if what == "regex" else Selection(exclude="*a")
    assert "\n" not in str(caught.value)


def test_a_topic_that_is_not_there_is_told_with_the_one_that_was_meant() -> None:
    Selection(["/words"]).check(["/words", "/moved"], "bag")
    with pytest.raises(BagError, match=r"bag has no topic '/wrds'; did you mean '/words'\?"):
        Selection(["/wrds"]).check(["/words", "/moved"], "bag")
