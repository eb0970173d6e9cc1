"""What the page of a scene that is dragged says: names, joints, edges, axes with their length, a legend."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from assembly.assembly import Assembly
from assembly.constraints.model.joint import Joint
from assembly.constraints.model.tangent import Tangent
from assembly.kinematics.pose import axes_quaternion
from assembly.view.item import Color
from assembly.view.marks import arrow, ball
from assembly.view.mesh import body_mesh, joined
from assembly.view.outline import body_lines
from assembly.view.said_in_window import round_length
from assembly.view.skeleton import COLOR, MARK
from assembly.view.style import Style

if TYPE_CHECKING:
    from viser import GuiApi, SceneApi

__all__ = ["Said"]

Array = NDArray[np.float64]
_EDGE = (35, 38, 45)
# In parts of the scene's radius, which is 1 in the page: joints' balls and arrows, and the axes at most.
_REACH, _AXES = 0.12, 0.4


def _bytes(color: Color) -> tuple[int, int, int]:
    red, green, blue = (round(255.0 * part) for part in color)
    return red, green, blue


class Said:
    """Names, joints and edges, which hang below their bodies and move with them.

    Parameters
    ----------
    assembly : Assembly
    scene : SceneApi
        Of viser; bodies are in it already.
    scale : float
        From lengths of the scene to those of the page.
    style : Style
    colors : sequence of Color
        Of the bodies.
    """

    def __init__(
        self, assembly: Assembly, scene: SceneApi, scale: float, style: Style, colors: Sequence[Color]
    ) -> None:
        self._assembly, self._scene, self._scale, self._style = assembly, scene, scale, style
        self._colors = colors
        names = style.labels_asked
        self.labels: dict[str, list[Any]] = {"bodies": [], "joints": []}
        self.glyphs: list[Any] = []
        for k, body in enumerate(assembly.bodies):
            below = f"/bodies/{k}"
            self.labels["bodies"].append(scene.add_label(f"{below}/name", body.name, visible="bodies" in names))
            lines = body_lines(body, body_mesh(body, angle=style.angle), style.angle) if style.edges else None
            if lines is not None and len(lines.segments):
                ends = (scale * lines.points[lines.segments]).astype(np.float32)
                scene.add_line_segments(f"{below}/edges", ends, _EDGE, thickness=1.5, thickness_units="screen")
        dot = ball().transformed(np.diag([MARK, MARK, MARK, 1.0]))
        mesh = joined([dot, arrow(-0.5 * _REACH, _REACH, 0.004, 0.014)])
        joints = [each for each in assembly.constraints if isinstance(each, Joint) and not isinstance(each, Tangent)]
        for j, joint in enumerate(joints):
            frame = joint.frame_a
            path = f"/bodies/{assembly.bodies.index(frame.body)}/joint {j}"
            place = tuple(scale * frame.origin)
            if style.glyphs != "none":
                turn = tuple(axes_quaternion(frame.axes))
                self.glyphs.append(
                    scene.add_mesh_simple(
                        path, mesh.vertices, mesh.triangles, color=_bytes(COLOR), position=place, wxyz=turn
                    )
                )
            label = scene.add_label(f"{path} name", joint.name, position=place, visible="joints" in names)
            self.labels["joints"].append(label)

    def add_axes(self, corner: Array) -> None:
        """Draw the axes at a corner in the page, with how long they are."""
        style, length = self._style, round_length(_AXES / self._scale)
        self.axes: list[Any] = []
        if not (style.axes or style.scale_bar):
            return
        arms = arrow(0.0, length * self._scale, 0.003, 0.009)
        turns = {"x": (0.0, 1.0, 0.0), "y": (-1.0, 0.0, 0.0), "z": (0.0, 0.0, 0.0)}
        for k, (name, axis) in enumerate(turns.items()):
            half = 0.25 * np.pi if any(axis) else 0.0
            turn = (np.cos(half), *(np.sin(half) * np.array(axis)))
            arm = self._scene.add_mesh_simple(
                f"/axes/{name}", arms.vertices, arms.triangles, color=_EDGE, position=tuple(corner), wxyz=turn
            )
            end = corner + length * self._scale * np.eye(3)[k]
            said = f"{name}  {style.length(length)}" if name == "x" and style.scale_bar else name
            self.axes += [arm, self._scene.add_label(f"/axes/{name} name", said, position=tuple(end))]

    def add_boxes(self, gui: GuiApi) -> None:
        """Put boxes that show and hide names and joints, and a legend where there is one."""
        for word, shown in (("names", self.labels["bodies"]), ("joints' names", self.labels["joints"])):
            if shown:
                gui.add_checkbox(word, bool(shown[0].visible)).on_update(_shows(shown))
        for word, shown in (("joints", self.glyphs), ("axes", self.axes)):
            if shown:
                gui.add_checkbox(word, True).on_update(_shows(shown))
        if self._style.legend:
            rows = zip(self._assembly.bodies, self._colors, strict=True)
            gui.add_html(
                "".join(
                    f'<div><span style="color: rgb{_bytes(color)}">&#9632;</span> {escape(body.name)}'
                    f"{', fixed' if body.fixed else ''}</div>"
                    for body, color in rows
                )
            )


def _shows(nodes: Sequence[Any]) -> Any:
    def change(event: Any) -> None:
        for node in nodes:
            node.visible = bool(event.target.value)

    return change
