"""Opens a page in Chromium without a window, and tells what it asked the network for and what it complained of."""

import json
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
_BROWSERS_OWN = "not an origin"  # initiator of what Chromium asks for by itself, whatever page is open


@dataclass(frozen=True)
class Opened:
    """A page that was opened: its document, its lines on the console, and the addresses that it asked for."""

    document: str
    console: list[str]
    requested: list[str]


def open_page(page: Path, folder: Path) -> Opened:
    """Open a file; the test is skipped where no Chromium is installed.

    Args:
        page: the file.
        folder: for the browser's own files.
    """
    browser = next((found for name in NAMES if (found := shutil.which(name))), None)
    if browser is None:
        pytest.skip(f"no Chromium is installed ({', '.join(NAMES)} are not on the PATH)")
    log = folder / "requests.json"
    command = [
        *(browser, "--headless", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"),
        *("--disable-component-update", "--host-resolver-rules=MAP * ~NOTFOUND", "--enable-logging=stderr"),
        *(f"--user-data-dir={folder / 'profile'}", f"--log-net-log={log}", "--dump-dom", page.resolve().as_uri()),
    ]
    result = subprocess.run(command, capture_output=True, text=True, timeout=120.0, check=True)
    events = [event.get("params", {}) for event in json.loads(log.read_text(encoding="utf-8"))["events"]]
    asked = [params["url"] for params in events if params.get("initiator", _BROWSERS_OWN) != _BROWSERS_OWN]
    own = page.resolve().as_uri()
    requested = [url for url in asked if url != own and not url.startswith("data:")]
    return Opened(result.stdout, re.findall(r":CONSOLE.*", result.stderr), requested)
