"""A picture as one HTML file that needs no server and no network.

The file holds meshcat's viewer, which comes with the meshcat package, and the commands that draw the picture.
"""

from __future__ import annotations

from base64 import b64encode
from html import escape
from importlib.util import find_spec
from os import PathLike
from pathlib import Path

from numpy.typing import ArrayLike

from assembly.assembly import Assembly
from assembly.solve.solution import Solution
from assembly.view.commands import commands, packed
from assembly.view.picture import DIRECTION, draw

__all__ = ["save_html"]

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{title}</title>
<style>
body {{ margin: 0; }}
#meshcat-pane {{ width: 100vw; height: 100vh; overflow: hidden; }}
</style>
</head>
<body>
<div id="meshcat-pane"></div>
<script>{viewer}</script>
<script>
const viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
for (const command of [
{commands}
]) viewer.handle_command_bytearray(Uint8Array.from(atob(command), c => c.charCodeAt(0)));
</script>
</body>
</html>
"""


def _viewer() -> str:
    """The script of meshcat's viewer; found without importing meshcat, which takes a while."""
    package = find_spec("meshcat")
    assert package is not None and package.submodule_search_locations
    folder = Path(package.submodule_search_locations[0])
    return (folder / "viewer" / "dist" / "main.min.js").read_text(encoding="utf-8")


def save_html(
    path: str | PathLike[str],
    scene: Assembly,
    solution: Solution | None = None,
    *,
    direction: ArrayLike = DIRECTION,
    title: str | None = None,
) -> None:
    """Write a scene as one HTML file to turn around in any browser, without server or network.

    Bodies are colored by their names ("red") or in turn, fixed ones grayer. Contacts are balls with the
    normal as an arrow, amber, or magenta where the surfaces interpenetrate. A point that is drawn to a target is
    joined with a cross at the target.

    Parameters
    ----------
    path : str or path
    scene : Assembly
    solution : Solution, optional
        Bodies stand where it says, and its contacts are shown; else they stand where they were made.
    direction : (3,)
        From the scene to the eye; z is upward.
    title : str, optional
        Of the page; the file's name by default.

    Raises
    ------
    InputError, TypeError
        See the message; also a scene without bodies, or a solution of other bodies.
    """
    picture = draw(scene, solution, direction)
    lines = ",\n".join(f'"{b64encode(packed(command)).decode("ascii")}"' for command in commands(picture))
    heading = escape(Path(path).stem if title is None else title)
    Path(path).write_text(_PAGE.format(title=heading, viewer=_viewer(), commands=lines), encoding="utf-8")
