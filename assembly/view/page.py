"""A picture, still or moving, as one HTML file that needs no server and no network.

The file holds meshcat's viewer, which comes with the meshcat package, and the commands that draw the picture, both
packed by gzip and written in base64, which browsers unpack. A command stands behind its length, a big-endian uint32.
"""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable
from functools import cache
from gzip import compress
from html import escape
from importlib.util import find_spec
from os import PathLike
from pathlib import Path

from numpy.typing import ArrayLike

from assembly._file_names import not_of_another
from assembly.assembly import Assembly
from assembly.errors import InputError, check_encodable
from assembly.kinematics.ellipsoid import Ellipsoid
from assembly.solve.solution import Solution
from assembly.studies.interference.clash import Interference
from assembly.view.commands import Command, commands, packed
from assembly.view.overlay import overlay
from assembly.view.picture import DIRECTION, draw
from assembly.view.style import Style

__all__ = ["page_text", "player", "save_html", "write_page"]

_PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<title>{title}</title>
<style>
body {{ margin: 0; }}
#meshcat-pane {{ width: 100vw; height: 100vh; overflow: hidden; }}
#player {{ position: fixed; left: 50%; bottom: 18px; transform: translateX(-50%); width: min(640px, 80vw);
  display: flex; align-items: center; gap: 12px; padding: 8px 16px; border-radius: 12px; box-sizing: border-box;
  background: rgba(255, 255, 255, 0.8); box-shadow: 0 1px 6px rgba(0, 0, 0, 0.2); font: 14px sans-serif; color: #333; }}
#player button {{ border: 0; background: none; padding: 4px; line-height: 0; cursor: pointer; }}
#player input[type=range] {{ flex: 1; min-width: 0; accent-color: #333; }}
#player output {{ white-space: nowrap; font-variant-numeric: tabular-nums; }}
#player label {{ white-space: nowrap; }}
</style>
</head>
<body>
<div id="meshcat-pane"></div>
{player}<script type="text/plain" id="packed-viewer">{viewer}</script>
<script type="text/plain" id="packed-drawing">{drawing}</script>
<script>
async function unpacked(id) {{
  const bytes = Uint8Array.from(atob(document.getElementById(id).textContent), c => c.charCodeAt(0));
  return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip")));
}}
function run(text) {{
  const script = document.createElement("script");
  script.textContent = text;
  document.body.append(script);
}}
var viewer;
// What needs the viewer is `text/plain` above, and is run once it is there.
const drawn = (async () => {{
  run(await (await unpacked("packed-viewer")).text());
  viewer = new MeshCat.Viewer(document.getElementById("meshcat-pane"));
  const drawing = new DataView(await (await unpacked("packed-drawing")).arrayBuffer());
  for (let at = 0; at < drawing.byteLength;) {{
    const length = drawing.getUint32(at);
    viewer.handle_command_bytearray(new Uint8Array(drawing.buffer, at + 4, length));
    at += 4 + length;
  }}
  for (const script of document.querySelectorAll("script.with-viewer")) run(script.textContent);
}})().catch(error => {{
  document.getElementById("meshcat-pane").textContent = `No picture: ${{error}} (browsers of 2023 and later show it)`;
}});
</script>
</body>
</html>
"""
# The viewer's own player is in its menu, and answers to its slider only once it has played. `#frame=12` at the end of
# the page's address opens it there, paused.
_PLAYER = """<div id="player">
<button id="play" type="button" aria-label="play or pause"><svg width="18" height="18"><path id="sign"/></svg></button>
<input id="slider" type="range" min="0" max="{last}" step="any" value="0" aria-label="frame">
<output id="frame"></output>
<label><input id="loop" type="checkbox"{checked}> loop</label>
</div>
<script type="text/plain" class="with-viewer">
const part = Object.fromEntries(
  ["play", "sign", "slider", "frame", "loop"].map(id => [id, document.getElementById(id)]));
const animator = viewer.animator;
// What to say in the place of the time.
const captions = [];
let clock = part => `${{(part * animator.duration).toFixed(2)}} of ${{animator.duration.toFixed(2)}} s`;
function seek(frame) {{
  animator.pause();
  animator.seek(frame / {last} * animator.duration);
  animator.display_progress(frame / {last} * animator.duration);
}}
part.play.onclick = () => animator.playing ? animator.pause() : animator.play();
part.slider.oninput = () => seek(Number(part.slider.value));
// Three.js's LoopRepeat and LoopOnce.
part.loop.onchange = () => animator.actions.forEach(
  action => part.loop.checked ? action.setLoop(2201, Infinity) : action.setLoop(2200, 1));
const asked = /^#frame=([0-9.]+)$/.exec(location.hash);
if (asked) seek(Math.min(Number(asked[1]), {last}));
function follow() {{
  requestAnimationFrame(follow);
  const frame = animator.time / animator.duration * {last};
  part.slider.value = frame;
  part.frame.value = captions[Math.round(frame)] ?? clock(animator.time / animator.duration);
  part.sign.setAttribute("d", animator.playing ? "M3 2h4v14h-4z M11 2h4v14h-4z" : "M4 2l12 7l-12 7z");
}}
follow();
</script>
"""


@cache
def _packed_viewer() -> str:
    """The script of meshcat's viewer; found without importing meshcat, which takes a while."""
    package = find_spec("meshcat")
    assert package is not None and package.submodule_search_locations
    folder = Path(package.submodule_search_locations[0])
    return _base64((folder / "viewer" / "dist" / "main.min.js").read_bytes())


def _base64(data: bytes) -> str:
    # Without a time: the same picture is the same file.
    return b64encode(compress(data, mtime=0)).decode("ascii")


def page_text(title: str, drawing: Iterable[Command], controls: str = "") -> str:
    """A page of commands."""
    data = b"".join(len(each).to_bytes(4, "big") + each for each in map(packed, drawing))
    return _PAGE.format(title=escape(title), viewer=_packed_viewer(), drawing=_base64(data), player=controls)


def write_page(path: str | PathLike[str], title: str | None, drawing: Iterable[Command], controls: str = "") -> None:
    """Write a page of commands; the file's name is the title where none is given."""
    if title is not None and not isinstance(title, str):
        raise InputError(f"title is {title!r}; expected a string or None")
    if title is not None:
        check_encodable("title", title)
    # The name of a file may be none that UTF-8 has.
    file = not_of_another(path, ".html", ".htm")
    heading = file.stem.encode(errors="replace").decode() if title is None else title
    file.write_text(page_text(heading, drawing, controls), encoding="utf-8")


def player(frames: int, loop: bool) -> str:
    """Controls of a page's motion: play and pause, a slider over the frames, a loop."""
    return _PLAYER.format(last=frames - 1, checked=" checked" if loop else "")


def save_html(
    path: str | PathLike[str],
    scene: Assembly,
    solution: Solution | None = None,
    *,
    ellipsoids: Ellipsoid | Iterable[Ellipsoid] = (),
    interference: Interference | None = None,
    direction: ArrayLike = DIRECTION,
    title: str | None = None,
    style: Style | None = None,
) -> None:
    """Write a scene as one HTML file to turn around in any browser, without server or network.

    Bodies are colored by their names ("red") or in turn, fixed ones grayer. A body without a shape is drawn as rods
    between its joints, a joint as a ball with an arrow along its z axis. Contacts are balls with the normal as an
    arrow, amber, or magenta where the surfaces interpenetrate; solids hide them unless a style asks for them. A point
    that is drawn to a target is joined with a cross at the target. The mouse shows names of what it is on.

    Parameters
    ----------
    path : str or path
    scene : Assembly
    solution : Solution, optional
        Bodies are shown at its poses, with its contacts; by default at their own poses.
    ellipsoids : Ellipsoid or several
        Drawn beside the bodies, half transparent, with their axes.
    interference : Interference, optional
        A report of this scene, instead of a solution: bodies that cross are red, all others faint, and the places of
        its rows are marked: dark red where bodies cross, amber where they touch, green where they are apart.
    direction : (3,)
        From the scene to the eye; z is upward.
    title : str, optional
        Of the page; the file's name by default.
    style : Style, optional
        What hides what, opacities, edges; which names, axes, scale and legend the page begins with.

    Raises
    ------
    InputError, TypeError
        See the message; also a scene without bodies, or a solution of other bodies.
    """
    picture = draw(scene, solution, direction, ellipsoids, interference, style)
    write_page(path, title, commands(picture), overlay(picture))
