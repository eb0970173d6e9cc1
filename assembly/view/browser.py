"""A picture in a browser window, through meshcat's server."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from contextlib import redirect_stdout
from io import StringIO
from typing import Any

from numpy.typing import ArrayLike

from assembly.assembly import Assembly
from assembly.solve.solution import Solution
from assembly.view.commands import commands
from assembly.view.picture import DIRECTION, draw

with warnings.catch_warnings():
    # Of its own imports: a module of pyzmq that calls itself deprecated.
    warnings.simplefilter("ignore", DeprecationWarning)
    from meshcat import Visualizer

__all__ = ["show"]

_running: list[Visualizer] = []


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


def show(
    scene: Assembly,
    solution: Solution | None = None,
    open: bool = False,
    *,
    direction: ArrayLike = DIRECTION,
    visualizer: Visualizer | None = None,
) -> Visualizer:
    """Draw a scene in a meshcat visualizer, in the place of what was shown before.

    Parameters
    ----------
    scene : Assembly
    solution : Solution, optional
        Bodies stand where it says, and its contacts are shown; else they stand where they were made.
    open : bool
        Whether to open a browser window. Without it nothing is opened; `visualizer.url()` is the address.
    direction : (3,)
        From the scene to the eye; z is upward.
    visualizer : meshcat.Visualizer, optional
        Where to draw. By default one that is started at the first call (a server process, which ends with
        this one) and used again.

    Returns
    -------
    meshcat.Visualizer

    Raises
    ------
    InputError, TypeError
        See the message; nothing is started then.
    """
    picture = draw(scene, solution, direction)
    if visualizer is not None and not isinstance(visualizer, Visualizer):
        raise TypeError(f"visualizer is {visualizer!r}; expected a meshcat.Visualizer")
    target = _visualizer() if visualizer is None else visualizer
    for command in commands(picture):
        target.window.send(_Sent(command))
    if open:
        target.open()
    return target
