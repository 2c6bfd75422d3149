"""The panel's texts are plain, and it shows one follower at a time."""

import html
import re
from unittest.mock import MagicMock

import numpy as np
import pytest

from robot_formation.viewing.moment import FollowerNow, Moment, TimestepFigures
from robot_formation.viewing.panel import Panel, plain


@pytest.mark.parametrize(
    "text",
    [
        "<img src=x onerror=alert(1)>",
        "</script><script>alert(1)</script>",
        "[a](javascript:alert(1)) ![b](http://x/y.png) {process.exit()} `c` **d** &lt; \\<b> www.x.org",
    ],
)
def test_no_character_that_markdown_or_html_reads_is_left_alone(text: str) -> None:
    found = plain(text)
    assert re.findall(r"(?<!\\)(?:\\\\)*[<>&`*_{}\[\]()!#|]", found) == []
    assert re.sub(r"\\(.)", r"\1", found) == text
    assert html.escape(plain("timestep 3")) == "timestep 3"


def test_a_text_stays_on_one_line() -> None:
    assert plain("lost\n\n# a title\n") == "lost \\# a title"


def test_words_of_a_follower_reach_the_page_escaped() -> None:
    server = MagicMock()
    panel = Panel(server, ["follower_1"])
    panel.tell(Moment(0, {}, {"follower_1": FollowerNow("<b>x</b>")}), None, "", [])
    content = server.gui.add_markdown.return_value.content
    assert "<b>" not in content
    assert "\\<b\\>x" in content


def test_another_follower_shows_nothing_of_the_last_one() -> None:
    server = MagicMock()
    panel = Panel(server, ["follower_1", "follower_2"])
    choice, gui = server.gui.add_dropdown.return_value, server.gui
    panel.tell(Moment(0), None, "", [TimestepFigures(1, 0.02, 0.01)])
    panel.picture(np.zeros((2, 2, 3), np.uint8))
    choice.value = "follower_2"
    choice.on_update.call_args[0][0](None)
    panel.act()
    assert panel.follower == "follower_2"
    gui.add_uplot.return_value.remove.assert_called_once_with()
    gui.add_image.return_value.remove.assert_called_once_with()
    panel.tell(Moment(0), None, "", [])
    assert gui.add_uplot.call_count == 1
    panel.tell(Moment(0), None, "", [TimestepFigures(1, 0.02, 0.01)])
    panel.picture(np.zeros((2, 2, 3), np.uint8))
    assert (gui.add_uplot.call_count, gui.add_image.call_count) == (2, 2)
