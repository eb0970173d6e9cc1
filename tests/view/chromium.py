"""Pictures of HTML files by a headless Chromium, as a page and as an array."""

from __future__ import annotations

import shutil
import struct
import subprocess
import sys
import tempfile
import zlib
from pathlib import Path

import numpy as np

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --disable-extensions --disable-dev-shm-usage --hide-scrollbars "
    "--use-angle=swiftshader --enable-unsafe-swiftshader --virtual-time-budget=4000"
).split()
# The viewer's menu is no part of a picture.
NO_MENU = "<style>.dg { display: none }</style></head>"


def _run(page: Path, fragment: str, script: str, *options: str) -> subprocess.CompletedProcess[str]:
    """Open a page at a fragment, `#...`, with a script at its end; network addresses do not resolve for it."""
    assert BROWSER is not None
    with tempfile.TemporaryDirectory() as folder:
        bare = Path(folder, "page.html")
        text = page.read_text(encoding="utf-8").replace("</head>", NO_MENU, 1)
        bare.write_text(text.replace("</body>", f"<script>{script}</script></body>"), encoding="utf-8")
        command = [BROWSER, *FLAGS, f"--user-data-dir={folder}/profile", "--host-resolver-rules=MAP * ~NOTFOUND"]
        command += [*options, bare.as_uri() + fragment]
        return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False)


def photograph(
    page: Path, picture: Path, width: int = 700, height: int = 500, scale: float = 1.0, fragment: str = ""
) -> None:
    """Write a PNG of a page."""
    size = (f"--window-size={width},{height}", f"--force-device-scale-factor={scale}")
    done = _run(page, fragment, "", *size, f"--screenshot={picture.absolute()}")
    assert picture.is_file(), done.stderr


def title_after(page: Path, script: str, fragment: str = "") -> str:
    """The title that a script gives a page within the time of a picture."""
    done = _run(page, fragment, script, "--dump-dom")
    return done.stdout.partition("<title>")[2].partition("</title>")[0]


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
    photograph(Path(sys.argv[1]), Path(sys.argv[2]), *numbers, fragment="".join(sys.argv[6:7]))
