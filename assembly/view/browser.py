"""A picture in a browser window, through meshcat's server."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from contextlib import redirect_stdout
from io import StringIO
from itertools import chain
from typing import Any
from weakref import WeakSet

from numpy.typing import ArrayLike

from assembly.assembly import Assembly
from assembly.kinematics.ellipsoid import Ellipsoid
from assembly.solve.solution import Solution
from assembly.studies.interference.clash import Interference
from assembly.view.commands import commands, motion, stillness
from assembly.view.item import Picture
from assembly.view.picture import DIRECTION, draw
from assembly.view.said_in_window import said_in_window
from assembly.view.style import Style

with warnings.catch_warnings():
    # Meshcat imports a deprecated module of pyzmq, which warns.
    warnings.simplefilter("ignore", DeprecationWarning)
    from meshcat import Visualizer

__all__ = ["display", "show"]

_running: list[Visualizer] = []
# Visualizers whose windows play a motion.
_moving: WeakSet[Any] = WeakSet()


class _Sent:
    """A command as meshcat's window wants it."""

    def __init__(self, command: Mapping[str, Any]) -> None:
        self._command = command

    def lower(self) -> Mapping[str, Any]:
        """The command."""
        return self._command


def _visualizer() -> Visualizer:
    """The one of this process, started at first use or when its server has ended."""
    if _running and _running[0].window.server_proc.poll() is None:
        return _running[0]
    with redirect_stdout(StringIO()):  # it announces itself
        _running[:] = [Visualizer()]
    return _running[0]


def display(
    picture: Picture, open: bool, visualizer: Visualizer | None, seconds: float = 0.0, loop: bool = False
) -> Visualizer:
    """Send a picture to a visualizer, in the place of what was there; a moving one lasts so many seconds."""
    if visualizer is not None and not isinstance(visualizer, Visualizer):
        raise TypeError(f"visualizer is {visualizer!r}; expected a meshcat.Visualizer")
    target = _visualizer() if visualizer is None else visualizer
    for command in chain(commands(picture), said_in_window(picture)):
        target.window.send(_Sent(command))
    if seconds > 0.0:
        target.window.send(_Sent(motion(picture, seconds, loop)))
        _moving.add(target.window)
    elif target.window in _moving:
        # Otherwise the last motion would go on unseen, and its slider would stay.
        target.window.send(_Sent(stillness()))
        _moving.discard(target.window)
    if open:
        target.open()
    return target


def show(
    scene: Assembly,
    solution: Solution | None = None,
    open: bool = False,
    *,
    ellipsoids: Ellipsoid | Iterable[Ellipsoid] = (),
    interference: Interference | None = None,
    direction: ArrayLike = DIRECTION,
    visualizer: Visualizer | None = None,
    style: Style | None = None,
) -> Visualizer:
    """Draw a scene in a meshcat visualizer, replacing what was shown before.

    Parameters
    ----------
    scene : Assembly
    solution : Solution, optional
        Bodies are shown at its poses, with its contacts; by default at their own poses.
    open : bool
        Whether to open a browser window. Without it nothing is opened; `visualizer.url()` is the address.
    ellipsoids : Ellipsoid or several
        Drawn beside the bodies, half transparent, with their axes.
    interference : Interference, optional
        A report of this scene, instead of a solution: bodies that cross are red, all others faint, and the places of
        its rows are marked: dark red where bodies cross, amber where they touch, green where they are apart.
    direction : (3,)
        From the scene to the eye; z is upward.
    visualizer : meshcat.Visualizer, optional
        Where to draw. By default one that is started at the first call (a server process, which ends with
        this one) and used again.
    style : Style, optional
        What hides what, opacities, edges, names, axes with their length; meshcat's window has no legend, and names
        nothing under the mouse.

    Returns
    -------
    meshcat.Visualizer

    Raises
    ------
    InputError, TypeError
        See the message; nothing is started then.
    """
    return display(draw(scene, solution, direction, ellipsoids, interference, style), open, visualizer)
