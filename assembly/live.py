"""``python -m assembly.live scene.json``: a scene to drag in a browser."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence

from assembly.errors import AssemblyError
from assembly.scene_file import load
from assembly.view import live

__all__ = ["main"]

ABOUT = """\
Opens a page in which the bodies of a scene file (asm.Assembly.save writes one) are taken with the mouse and dragged,
joints, contacts and clearances held. Ends with Ctrl-C."""


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m assembly.live", description=ABOUT)
    parser.add_argument("file", help="a scene file")
    parser.add_argument("--host", default="127.0.0.1", help="whom the page is for; 0.0.0.0: everybody on the network")
    parser.add_argument("--port", type=int, default=8080, help="of the page; if in use, the next free one is taken")
    parser.add_argument("--stiffness", type=float, default=1.0, help="of the spring that the mouse draws with")
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Serve the page until Ctrl-C; 2 where there is nothing to serve."""
    wanted = _parser().parse_args(arguments)
    try:
        page = live(load(wanted.file), stiffness=wanted.stiffness, host=wanted.host, port=wanted.port)
    except (AssemblyError, ImportError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    with page:
        print(f"{page.url}; Ctrl-C ends it", flush=True)
        try:
            page.wait()
        except KeyboardInterrupt:
            return 0
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
