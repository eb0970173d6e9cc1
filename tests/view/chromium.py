"""Pictures of HTML files by a headless Chromium, as a page and as an array."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import struct
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
# Network addresses but this machine do not resolve for it. It reads from file 3 what it is told, and answers into 4.
FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --disable-extensions --disable-dev-shm-usage --hide-scrollbars "
    "--use-angle=swiftshader --enable-unsafe-swiftshader --remote-debugging-pipe"
).split() + ["--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"]
# The viewer's menu and boxes are no part of a picture.
NO_MENU = "<style>.dg, #choices { display: none }</style></head>"
# Virtual milliseconds that a page has before it is looked at, and seconds that an answer may take.
BUDGET, PATIENCE = 2000, 120.0


class Chromium:
    """One process for all pages, which takes longer to start than to show a page."""

    def __init__(self, folder: Path) -> None:
        assert BROWSER is not None
        self._folder = folder
        self._count, self._rest, self._events = 0, b"", []
        read, self._questions = os.pipe()
        self._answers, write = os.pipe()
        command = ["sh", "-c", f'exec "$0" "$@" 3</dev/fd/{read} 4>/dev/fd/{write}', BROWSER]
        command += [*FLAGS, f"--user-data-dir={folder}"]
        null = subprocess.DEVNULL
        self._process = subprocess.Popen(command, pass_fds=(read, write), stdin=null, stdout=null, stderr=null)
        os.close(read)
        os.close(write)

    def close(self) -> None:
        """End the process."""
        self._ask("Browser.close")
        self._process.wait(PATIENCE)
        os.close(self._questions)
        os.close(self._answers)

    def _next(self) -> dict[str, Any]:
        """What it says next: an answer or an event."""
        while b"\0" not in self._rest:
            assert select.select([self._answers], [], [], PATIENCE)[0], f"no answer in {PATIENCE:g} seconds"
            data = os.read(self._answers, 1 << 20)
            assert data, "Chromium ended"
            self._rest += data
        message, _, self._rest = self._rest.partition(b"\0")
        return json.loads(message)

    def _ask(self, method: str, session: str | None = None, **parameters: Any) -> dict[str, Any]:
        """The result of a method of Chromium's protocol."""
        self._count += 1
        question = {"id": self._count, "method": method, "params": parameters}
        if session is not None:
            question["sessionId"] = session
        os.write(self._questions, json.dumps(question).encode() + b"\0")
        self._events.clear()
        while (answer := self._next()).get("id") != self._count:
            self._events.append(answer.get("method"))
        assert "error" not in answer, answer
        return answer["result"]

    @contextmanager
    def _opened(self, page: Path, fragment: str, script: str, width: int, height: int, scale: float) -> Iterator[str]:
        """The session of a page at a fragment, `#...`, with a script at its end, after its virtual time."""
        bare = self._folder / "page.html"
        text = page.read_text(encoding="utf-8").replace("</head>", NO_MENU, 1)
        # A page of ours is drawn once its viewer is unpacked; meshcat's own page has its viewer at once.
        later = f'<script>(typeof drawn === "undefined" ? Promise.resolve() : drawn).then(() => {{{script}}})</script>'
        bare.write_text(text.replace("</body>", f"{later}</body>"), encoding="utf-8")
        target = self._ask("Target.createTarget", url="about:blank")["targetId"]
        session = self._ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        size = {"width": width, "height": height, "deviceScaleFactor": scale, "mobile": False}
        self._ask("Emulation.setDeviceMetricsOverride", session, **size)
        self._ask("Page.enable", session)
        self._ask("Page.navigate", session, url=bare.as_uri() + fragment)
        self._wait("Page.loadEventFired")
        # Virtual time does not wait for other threads, which may unpack the viewer.
        drawn = 'typeof drawn === "undefined" ? 0 : drawn.then(() => 0)'
        self._ask("Runtime.evaluate", session, expression=drawn, awaitPromise=True)
        self._ask("Emulation.setVirtualTimePolicy", session, policy="pauseIfNetworkFetchesPending", budget=BUDGET)
        self._wait("Emulation.virtualTimeBudgetExpired")
        yield session
        self._ask("Target.closeTarget", targetId=target)

    @contextmanager
    def visited(self, url: str, width: int = 640, height: int = 400, scale: float = 0.5) -> Iterator[str]:
        """The session of a page of a server of this machine, in real time, for somebody of whom no page knows yet.

        The page is laid out in width x height pixels and drawn in so many times fewer, each way: a picture costs its
        pixels. What the mouse is told is in pixels of the layout.
        """
        person = self._ask("Target.createBrowserContext")["browserContextId"]
        target = self._ask("Target.createTarget", url="about:blank", browserContextId=person)["targetId"]
        session = self._ask("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        size = {"width": width, "height": height, "deviceScaleFactor": scale, "mobile": False}
        self._ask("Emulation.setDeviceMetricsOverride", session, **size)
        self._ask("Page.enable", session)
        self._ask("Page.navigate", session, url=url)
        self._wait("Page.loadEventFired")
        yield session
        self._ask("Target.disposeBrowserContext", browserContextId=person)

    def mouse(self, session: str, kind: str, x: float, y: float, pressed: bool = True) -> None:
        """Send a page an event of the left button: "mousePressed", "mouseMoved" or "mouseReleased"."""
        held = {"button": "left", "buttons": 1, "clickCount": 1} if pressed else {"button": "none", "buttons": 0}
        self._ask("Input.dispatchMouseEvent", session, type=kind, x=x, y=y, **held)

    def shot(self, session: str, picture: Path) -> None:
        """Write a PNG of a page that is open."""
        found = self._ask("Page.captureScreenshot", session, format="png", optimizeForSpeed=True)
        picture.write_bytes(base64.b64decode(found["data"]))

    def _wait(self, event: str) -> None:
        """Until an event has come, which may have been before the answer to what was asked last."""
        while event not in self._events:
            self._events.append(self._next().get("method"))

    def photograph(
        self, page: Path, picture: Path, width: int = 700, height: int = 500, scale: float = 1.0, fragment: str = ""
    ) -> None:
        """Write a PNG of a page."""
        with self._opened(page, fragment, "", width, height, scale) as session:
            # While virtual time stands still there may be no frame to take a picture of.
            self._ask("Emulation.setVirtualTimePolicy", session, policy="advance")
            # Larger files whose rows are quick to decode.
            found = self._ask("Page.captureScreenshot", session, format="png", optimizeForSpeed=True)
        picture.write_bytes(base64.b64decode(found["data"]))

    def title_after(self, page: Path, script: str, fragment: str = "") -> str:
        """The title that a script gives a page within the time of a picture."""
        with self._opened(page, fragment, script, 700, 500, 1.0) as session:
            return self._ask("Runtime.evaluate", session, expression="document.title")["result"]["value"]


def decoded(picture: Path) -> np.ndarray:
    """Pixels (height, width, 3) of a PNG of 8-bit RGB or RGBA, not interlaced."""
    data = picture.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    at, body = 8, b""
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        chunk = data[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            width, height, depth, color, _, _, interlace = struct.unpack(">IIBBBBB", chunk)
            assert (depth, interlace) == (8, 0) and color in (2, 6)
        elif kind == b"IDAT":
            body += chunk
        at += 12 + length
    channels = 3 if color == 2 else 4
    rows = np.frombuffer(zlib.decompress(body), dtype=np.uint8).reshape(height, 1 + width * channels)
    pixels = np.zeros((height + 1, width + 1, channels), dtype=np.int64)  # with a zero row above, a column to the left
    for y, row in enumerate(rows, 1):
        kind, line = row[0], row[1:].reshape(width, channels).astype(np.int64)
        if kind == 0:
            pixels[y, 1:] = line
        elif kind == 1:
            pixels[y, 1:] = np.cumsum(line, axis=0) % 256
        elif kind == 2:
            pixels[y, 1:] = (line + pixels[y - 1, 1:]) % 256
        else:
            for x in range(1, width + 1):
                left, up, corner = pixels[y, x - 1], pixels[y - 1, x], pixels[y - 1, x - 1]
                if kind == 3:
                    guess = (left + up) // 2
                else:  # Paeth: the neighbor nearest to left + up - corner
                    near = np.abs(np.stack([up - corner, left - corner, left + up - 2 * corner]))
                    guess = np.choose(near.argmin(axis=0), (left, up, corner))
                pixels[y, x] = (line[x - 1] + guess) % 256
    return pixels[1:, 1:, :3].astype(np.uint8)


if __name__ == "__main__":
    # python tests/view/chromium.py page.html picture.png [width height [scale [#frame=12]]]
    numbers = (*map(int, sys.argv[3:5]), *map(float, sys.argv[5:6]))
    with tempfile.TemporaryDirectory() as place:
        chromium = Chromium(Path(place))
        chromium.photograph(Path(sys.argv[1]), Path(sys.argv[2]), *numbers, fragment="".join(sys.argv[6:7]))
        chromium.close()
