"""A headless Chromium that a test drives by its debugging protocol; skips the test where there is none."""

from __future__ import annotations

import itertools
import json
import shutil
import subprocess
import time
import urllib.request
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
# It draws without a graphics card, and finds no host but this machine.
_OPTIONS = (
    *("--headless=new", "--no-sandbox", "--no-first-run", "--disable-extensions", "--disable-dev-shm-usage"),
    *("--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"),
    *("--remote-debugging-port=0", "--window-size=400,500"),
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)
DEADLINE_S = 120.0  # drawing without a graphics card takes long on a machine that others keep busy


class Chromium:
    """One page in a browser of the test's own; a context manager.

    Attributes:
        errors: what the page complained of on its console, and exceptions that nothing caught.
        requests: addresses that it asked for, without those inside the page itself.
    """

    def __init__(self, folder: Path) -> None:
        program = next((found for name in _NAMES if (found := shutil.which(name))), None)
        if program is None:
            pytest.skip(f"no Chromium is installed (looked for {', '.join(_NAMES)})")
        client = pytest.importorskip("websockets.sync.client")
        self._process = subprocess.Popen(
            [program, *_OPTIONS, f"--user-data-dir={folder}", "about:blank"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self.errors: list[str] = []
        self.requests: list[str] = []
        self._numbers = itertools.count(1)
        try:
            self._socket = client.connect(self._debugger(folder), max_size=None)
        except BaseException:
            self._end()
            raise
        for domain in ("Runtime", "Network", "Page", "Log"):
            self._call(f"{domain}.enable")

    def open(self, address: str) -> None:
        """Go to a page."""
        self._call("Page.navigate", url=address)

    def value(self, expression: str) -> Any:
        """Return what an expression of JavaScript gives."""
        answer = self._evaluate(expression)
        assert "exceptionDetails" not in answer, f"{expression}: {answer['exceptionDetails']}"
        return answer["result"].get("value")

    def until(self, expression: str, unless: Callable[[], bool] = lambda: False, deadline_s: float = DEADLINE_S) -> Any:
        """Wait until an expression gives something true, or until there is no more to wait for; return what it gave.

        It may fail until then: a page that is still loading has no body.
        """
        end = time.monotonic() + deadline_s
        while not (found := self._evaluate(expression)["result"].get("value")) and not unless():
            assert time.monotonic() < end, f"{expression} did not come true; the page says: {self.value(_TEXT)}"
            time.sleep(0.1)
        return found

    def __enter__(self) -> Chromium:
        return self

    def __exit__(self, *error: object) -> None:
        self._socket.close()
        self._end()

    def _end(self) -> None:
        self._process.kill()
        self._process.wait()

    def _debugger(self, folder: Path) -> str:
        file, end = folder / "DevToolsActivePort", time.monotonic() + DEADLINE_S
        while not (file.exists() and file.read_text().count("\n")):
            assert time.monotonic() < end, "Chromium does not start"
            assert self._process.poll() is None, "Chromium has ended"
            time.sleep(0.05)
        port = file.read_text().splitlines()[0]
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
            pages = [page for page in json.load(answer) if page["type"] == "page"]
        return str(pages[0]["webSocketDebuggerUrl"])

    def _evaluate(self, expression: str) -> dict[str, Any]:
        return self._call("Runtime.evaluate", expression=expression, returnByValue=True)

    def _call(self, method: str, **parameters: object) -> dict[str, Any]:
        number = next(self._numbers)
        self._socket.send(json.dumps({"id": number, "method": method, "params": parameters}))
        while True:
            message = json.loads(self._socket.recv(timeout=DEADLINE_S))
            if message.get("id") == number:
                assert "error" not in message, message
                return dict(message["result"])
            self._note(message.get("method"), message.get("params", {}))

    def _note(self, method: str | None, said: dict[str, Any]) -> None:
        if method == "Runtime.consoleAPICalled" and said["type"] in ("error", "assert"):
            self.errors.append(str([argument.get("value") for argument in said["args"]]))
        elif method == "Runtime.exceptionThrown":
            self.errors.append(str(said["exceptionDetails"].get("exception", said["exceptionDetails"]["text"])))
        elif method == "Log.entryAdded" and said["entry"]["level"] == "error":
            self.errors.append(f"{said['entry']['text']} {said['entry'].get('url', '')}")
        elif method == "Network.requestWillBeSent":
            url = said["request"]["url"]
            if not url.startswith(("data:", "blob:", "about:")):
                self.requests.append(url)


_TEXT = "document.body ? document.body.innerText.slice(0, 1000) : ''"
