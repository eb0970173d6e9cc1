"""A scene to turn around inside a notebook: the page that `save_html` writes, in a frame of the cell's output."""

from __future__ import annotations

from dataclasses import dataclass, field
from html import escape

from numpy.typing import ArrayLike

from assembly.assembly import Assembly
from assembly.errors import integer
from assembly.kinematics.body import Body
from assembly.solve.solution import Solution
from assembly.view.commands import commands
from assembly.view.overlay import overlay
from assembly.view.page import page_text
from assembly.view.picture import DIRECTION, draw
from assembly.view.style import Style

__all__ = ["NotebookView", "notebook"]


@dataclass(frozen=True)
class NotebookView:
    """A page that a notebook shows as the result of a cell.

    Attributes
    ----------
    page : str
        The whole page, with its viewer: it needs no server, and no network.
    height : int
        Of the frame, in pixels.
    """

    page: str = field(repr=False)
    height: int

    def _repr_html_(self) -> str:
        text = escape(self.page, quote=True)
        return f'<iframe srcdoc="{text}" style="width: 100%; height: {self.height}px; border: 0"></iframe>'


def notebook(
    scene: Assembly | Body,
    solution: Solution | None = None,
    *,
    height: int = 360,
    direction: ArrayLike = DIRECTION,
    style: Style | None = None,
) -> NotebookView:
    """Show a scene, or one body, in a notebook, to be turned with the mouse: make it the last line of a cell.

    Parameters
    ----------
    scene : Assembly or Body
    solution : Solution, optional
        Bodies are shown at its poses, with its contacts.
    height : int
        Of the picture, in pixels, 50 to 5000.
    direction : (3,)
        From the scene to the eye; z is upward.
    style : Style, optional
        As in `save_html`.

    Raises
    ------
    InputError, TypeError
        See the message; also a scene without bodies, or a solution of other bodies.
    """
    pixels = integer("height", height, 50, 5000)
    shown = Assembly([scene]) if isinstance(scene, Body) else scene
    picture = draw(shown, solution, direction, style=style)
    return NotebookView(page_text("assembly", commands(picture), overlay(picture)), pixels)
