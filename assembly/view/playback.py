"""A tracker's log, played in its own time, with what happened beside it."""

from __future__ import annotations

from dataclasses import replace
from html import escape
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.assembly import Assembly
from assembly.errors import InputError, integer, positive
from assembly.kinematics.ellipsoid import Ellipsoid
from assembly.kinematics.pose import rotation_matrix
from assembly.tracking.log import TrackLog
from assembly.tracking.trace import Trace
from assembly.view.animation import present, require_flag
from assembly.view.picture import DIRECTION, film
from assembly.view.series import poses_at
from assembly.view.style import Style

if TYPE_CHECKING:
    from meshcat import Visualizer

__all__ = ["replay"]

Array = NDArray[np.float64]
# Radius of the ball that is the hand, over the largest body.
_HAND = 0.03
_HAND_COLOR = (0.16, 0.17, 0.20)
# Events that a page lists; a longer list says how many are missing.
_LISTED = 500

_PANEL = """<div id="happened">
<style>
#happened {{ position: fixed; left: 12px; top: 36px; max-height: calc(100vh - 240px); max-width: 40vw; overflow: auto;
  padding: 8px 12px; border-radius: 12px; background: rgba(255, 255, 255, 0.8); font: 13px sans-serif; color: #333; }}
#happened button {{ display: block; border: 0; background: none; padding: 2px 0; font: inherit; color: inherit;
  text-align: left; cursor: pointer; font-variant-numeric: tabular-nums; }}
#happened button.ahead {{ opacity: 0.4; }}
</style>
<output id="clock"></output>
{events}
</div>
<script type="text/plain" class="with-viewer">
const happened = [...document.querySelectorAll("#happened button")];
clock = part => `${{({begin} + part * {span}).toFixed(3)}} s`;
happened.forEach(entry => entry.onclick = () => seek(Number(entry.dataset.frame)));
function tell() {{
  requestAnimationFrame(tell);
  const part = animator.time / animator.duration;
  document.getElementById("clock").value = clock(part);
  happened.forEach(entry => entry.className = Number(entry.dataset.frame) > part * {last} + 1e-6 ? "ahead" : "");
}}
tell();
</script>
"""


def replay(
    scene: Assembly,
    log: TrackLog,
    path: str | PathLike[str] | None = None,
    *,
    speed: float = 1.0,
    frames: int = 300,
    hand: Trace | None = None,
    loop: bool = True,
    direction: ArrayLike = DIRECTION,
    title: str | None = None,
    open: bool = False,
    visualizer: Visualizer | None = None,
    style: Style | None = None,
) -> Visualizer | None:
    """Play what a tracker did, in the time it had, in a meshcat visualizer or, with a path, in one HTML file.

    Frames are evenly spread over the log's time; between its poses a body moves along a screw. What is drawn, the
    controls and `#frame=12` are those of `animate`. The file also has a clock and the list of events, at their times:
    a click on one goes there.

    Parameters
    ----------
    scene : Assembly
    log : TrackLog
        Of this scene's bodies, with two poses at least.
    path : str or path, optional
        The file to write.
    speed : float
        Seconds of the log over seconds of the film: 2 is twice as fast.
    frames : int
        At most; not more than the log has poses.
    hand : Trace, optional
        What was followed, points or poses: drawn as a dark, transparent ball with its axes.
    loop, direction, title, open, visualizer, style
        As in `animate`.

    Returns
    -------
    meshcat.Visualizer, or None with a path

    Raises
    ------
    InputError, TypeError
        See the message; nothing is written or started then.
    """
    if not isinstance(scene, Assembly):
        raise TypeError(f"scene is {scene!r}; expected an Assembly")
    if not isinstance(log, TrackLog):
        raise TypeError(f"log is of type {type(log).__name__}; expected a TrackLog")
    if hand is not None and not isinstance(hand, Trace):
        raise TypeError(f"hand is {hand!r}; expected a Trace, or None")
    if hand is not None and hand.kind == "numbers":
        raise InputError("hand has numbers, which are at no place; expected a Trace of points or poses")
    pace = positive("speed", speed)
    most = integer("frames", frames, 2, 100_000)
    require_flag("loop", loop)
    if log.q.shape[1] != len(scene.bodies):
        raise InputError(f"log has poses of {log.q.shape[1]} bodies; expected {len(scene.bodies)}, those of the scene")
    if len(log.q) < 2:
        raise InputError("log has poses of 1 tick; expected two at least")
    recorded = log.pose_times
    times = np.linspace(recorded[0], recorded[-1], min(most, len(recorded)))
    rows = poses_at(log.q, np.interp(times, recorded, np.arange(float(len(recorded)))))
    balls = [] if hand is None else _balls(scene, hand.at(times))
    picture = film(scene, rows, direction, balls, style)
    # What is under the mouse, and in the legend, is no ellipsoid of somebody's.
    named = (replace(item, said="hand") if item.kind == "ellipsoids" and item.said else item for item in picture.items)
    picture = replace(picture, items=tuple(named))
    span = float(times[-1] - times[0])
    return present(picture, path, span / pace, loop, title, open, visualizer, _panel(log, times))


def _balls(scene: Assembly, targets: Array) -> list[Ellipsoid]:
    """The hand at targets (frames, 3) or (frames, 7)."""
    reach = float(np.ptp(targets[:, :3], axis=0).max())
    radius = _HAND * max([reach, *(body.size for body in scene.bodies)])
    turns = [np.eye(3) if len(row) == 3 else rotation_matrix(row[3:]) for row in targets]
    return [Ellipsoid(row[:3], turn, np.full(3, radius), _HAND_COLOR) for row, turn in zip(targets, turns, strict=True)]


def _panel(log: TrackLog, times: Array) -> str:
    """A clock and the events; one after the last pose stands at the end."""
    span, last = float(times[-1] - times[0]), len(times) - 1
    lines = []
    for tick, event in log.events[:_LISTED]:
        when = float(log.times[tick])
        frame = min((when - float(times[0])) / span, 1.0) * last
        lines.append(f'<button type="button" data-frame="{frame:.6g}">{when:.3f} s {escape(str(event))}</button>')
    if len(log.events) > _LISTED:
        lines.append(f"and {len(log.events) - _LISTED} more")
    return _PANEL.format(events="\n".join(lines), begin=repr(float(times[0])), span=repr(span), last=last)
