"""A trajectory that plays, in a browser window or in a file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from os import PathLike
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from assembly.assembly import Assembly
from assembly.errors import InputError, check_encodable, items, positive
from assembly.kinematics.ellipsoid import Ellipsoid
from assembly.view.captions import captions_text, driven_captions
from assembly.view.commands import commands, motion
from assembly.view.item import Picture
from assembly.view.overlay import overlay
from assembly.view.page import player, write_page
from assembly.view.picture import DIRECTION, film
from assembly.view.series import Trajectory
from assembly.view.style import Style

if TYPE_CHECKING:
    from meshcat import Visualizer

__all__ = ["animate", "present", "require_flag"]


def animate(
    scene: Assembly,
    trajectory: Trajectory,
    path: str | PathLike[str] | None = None,
    *,
    seconds: float = 5.0,
    loop: bool = True,
    captions: Iterable[str] = (),
    ellipsoids: Ellipsoid | Iterable[Ellipsoid | Iterable[Ellipsoid]] = (),
    direction: ArrayLike = DIRECTION,
    title: str | None = None,
    open: bool = False,
    visualizer: Visualizer | None = None,
    style: Style | None = None,
) -> Visualizer | None:
    """Play a trajectory, in a meshcat visualizer or, with a path, in one HTML file without server or network.

    All frames take the same time. Between two frames a body moves along a screw, at constant speed. What is drawn
    is what `save_html` draws; contacts are those of the solutions, in magenta if the surfaces interpenetrate in any
    frame; targets are where they are now.

    The file plays by itself; it has a button to pause, a slider over the frames and a box to loop. `#frame=12` at
    the end of its address opens it there, paused. The visualizer has the like in its menu.

    Parameters
    ----------
    scene : Assembly
    trajectory : (frames, n, 7) or sequence of Solution
        Poses of all bodies, rows as in `scene.q`, or solutions of the scene; two frames at least.
    path : str or path, optional
        The file to write.
    seconds : float
        From the first frame to the last.
    loop : bool
        Whether it starts again at the end.
    captions : iterable of str
        Text in the play bar of a file at each frame; by default the coordinates of joints that are driven through
        solutions, or the time.
    ellipsoids : Ellipsoid, or for each frame one or several
        A single one stays as it is.
    direction : (3,)
        From the scene to the eye; z is upward.
    title : str, optional
        Of the page; the file's name by default.
    open : bool
        Whether to open a browser window on the visualizer; not with a path.
    visualizer : meshcat.Visualizer, optional
        As in `show`; not with a path.
    style : Style, optional
        As in `save_html`, or in `show` without a path.

    Returns
    -------
    meshcat.Visualizer, or None with a path

    Raises
    ------
    InputError, TypeError
        See the message; nothing is written or started then.
    """
    duration = positive("seconds", seconds)
    require_flag("loop", loop)
    said = items("captions", captions, "a string for each frame")
    # An iterator can be read only once.
    shown = [*trajectory] if isinstance(trajectory, Iterator) else trajectory
    picture = film(scene, shown, direction, ellipsoids, style)
    frames = round(float(picture.times[-1])) + 1
    for k, text in enumerate(said):
        if not isinstance(text, str):
            raise TypeError(f"captions[{k}] is {text!r}; expected a string")
        check_encodable(f"captions[{k}]", text)
    if isinstance(captions, str) or len(said) not in (0, frames):
        raise InputError(f"captions has {len(said)} texts; expected one for each of {frames} frames")
    if said and path is None:
        raise InputError("captions is given without a path; expected a path: the window's own player has none")
    if not said and path is not None:
        said = driven_captions(scene, shown, picture.style)
    beside = captions_text(said) if said else ""
    return present(picture, path, duration, loop, title, open, visualizer, beside)


def require_flag(name: str, value: object) -> None:
    """Raise unless a value is True or False."""
    if not isinstance(value, (bool, np.bool_)):
        raise InputError(f"{name} is {value!r}; expected True or False")


def present(
    picture: Picture,
    path: str | PathLike[str] | None,
    duration: float,
    loop: bool,
    title: str | None,
    open: bool,
    visualizer: Visualizer | None,
    beside: str = "",
) -> Visualizer | None:
    """Play a moving picture as `animate` does; markup may stand beside it in a file."""
    if path is None:
        if title is not None:
            raise InputError(f"title is {title!r} without a path; expected a path to write a page to, or no title")
        # Its import of meshcat is for those who want a window.
        from assembly.view.browser import display

        return display(picture, open, visualizer, duration, loop)
    if open or visualizer is not None:
        raise InputError("open or visualizer is given with a path; expected either a file or a window")
    frames = round(float(picture.times[-1])) + 1
    controls = player(frames, loop) + overlay(picture) + beside
    write_page(path, title, [*commands(picture), motion(picture, duration, loop)], controls)
    return None
