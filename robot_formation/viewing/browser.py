"""A server for browsers on this machine."""

from __future__ import annotations

import contextlib
import io
import os
import socket
from collections.abc import Iterator
from typing import Any

from robot_formation.errors import FormationError
from robot_formation.extras import require

HOST = "127.0.0.1"
"""Only browsers of this machine get in: nobody is asked for a password."""
DEFAULT_PORT = 8080


class ViewError(FormationError):
    """A run can't be shown; the text says why."""


def check_viewer(port: int) -> int:
    """Check that a view can be served.

    Args:
        port: of this machine; 0 for any free one.

    Returns:
        The port, which is free now.

    Raises:
        MissingExtraError: viser isn't installed.
        ViewError: it can't be imported, or the port can't be used.
    """
    _viser()
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind((HOST, port))
        except OSError as error:
            reason = f"port {port} of {HOST} can't be used ({error.strerror})"
            raise ViewError(f"{reason}; choose another one, or 0 for any free one") from error
        return int(probe.getsockname()[1])


@contextlib.contextmanager
def view_server(port: int, title: str) -> Iterator[Any]:
    """Serve a page until the context ends.

    Args:
        port: of this machine; 0 for any free one.
        title: above the page's controls.

    Yields:
        viser's ViserServer.

    Raises:
        ViewError: viser isn't installed, or the port can't be used.
    """
    check_viewer(port)
    with _quiet():
        server = _viser().ViserServer(host=HOST, port=port, label=title, verbose=False)
    try:
        if port and server.get_port() != port:  # it takes the next one if another process was faster
            raise ViewError(f"port {port} of {HOST} can't be used (taken a moment ago); choose another one")
        # The button would send the page over a server on the internet.
        server.gui.configure_theme(show_logo=False, show_share_button=False, control_width="large")
        server.gui.main_panel.dock_right()
        yield server
    finally:
        with _quiet():
            server.stop()


def address(port: int) -> str:
    """Return the page's address."""
    return f"http://{HOST}:{port}"


def open_browser(url: str) -> str:
    """Open a page where there is a display; return a line for people that says what to do or what was done."""
    if not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        port = url.rpartition(":")[2]
        return (
            f"view: {url} (no display here: open it in a browser of this machine, or from another one after "
            f"ssh -L {port}:{HOST}:{port})"
        )
    import webbrowser  # not above: the launcher of a run without a view needs none

    opened = webbrowser.open(url)
    return f"view: {url}" + ("" if opened else " (no browser was found: open it in one)")


def _quiet() -> contextlib.AbstractContextManager[object]:
    """Swallow what viser says of its start and end: standard output is for results."""
    return contextlib.redirect_stdout(io.StringIO())


def _viser() -> Any:
    require("view")
    try:
        import viser
    except ImportError as error:
        raise ViewError(f"viser can't be imported ({error}): pip install --force-reinstall viser") from error
    return viser
