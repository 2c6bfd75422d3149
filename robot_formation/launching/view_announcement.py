"""Tells where a run's view is, as soon as it is there."""

from __future__ import annotations

import socket
from collections.abc import Callable

from robot_formation.viewing.browser import HOST, address, open_browser


class Announcement:
    """Opens a browser where there is a display, once the viewer serves.

    Args:
        port: the viewer's.
        say: takes the line that tells about it.
    """

    def __init__(self, port: int, say: Callable[[str], None]) -> None:
        self._port, self._say = port, say
        self._said = False

    def look(self) -> None:
        """Look whether it is time."""
        if self._said:
            return
        with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
            self._said = probe.connect_ex((HOST, self._port)) == 0
        if self._said:
            self._say(open_browser(address(self._port)))
