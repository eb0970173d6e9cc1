"""How mates refer to faces, edges, vertices, points and frames of bodies: by the body's name, and name or number."""

from __future__ import annotations

from typing import Any

from assembly.errors import InputError
from assembly.kinematics.body import BodyFace
from assembly.kinematics.frame import Frame, Point
from assembly.scene_file.fields import at, bad, members, text, vector, whole
from assembly.scene_file.records import Form, Parts
from assembly.scene_file.references import BODY_NAME
from assembly.selection.edges import BodyEdge
from assembly.selection.vertices import BodyVertex

__all__ = ["Feature"]

_FIELDS = ("face", "edge", "vertex", "point")


class Feature:
    """A face by its name, an edge or a vertex by its number, a point by its coordinates; a frame as `frame` has it.

    Parameters
    ----------
    frame : Form
    """

    def __init__(self, frame: Form) -> None:
        self._frame = frame

    def write(self, path: str, value: Any, parts: Parts) -> Any:
        """See `Form`."""
        if isinstance(value, Frame):
            return self._frame.write(path, value, parts)
        if isinstance(value, BodyFace):
            return {"body": value.body.name, "face": value.name}
        if isinstance(value, Point):
            return {"body": value.body.name, "point": value.coordinates.tolist()}
        word = "edge" if isinstance(value, BodyEdge) else "vertex"
        return {"body": value.body.name, word: value.index}

    def read(self, path: str, value: Any, parts: Parts) -> Any:
        """See `Form`."""
        if not isinstance(value, dict):
            raise bad(path, value, f"an object with body and one of {', '.join(_FIELDS)}, or a frame")
        word = next((word for word in _FIELDS if word in value), None)
        if word is None:
            return self._frame.read(path, value, parts)
        name, which = members(path, value, ("body", word))
        body = BODY_NAME.read(f"{path}.body", name, parts)
        where = f"{path}.{word}"
        if word == "face":
            label = text(where, which)
            with at(where):
                return body.face(label)
        if word == "point":
            with at(where):
                return body.point(*vector(where, which))
        number = whole(where, which)
        every: tuple[BodyEdge, ...] | tuple[BodyVertex, ...] = body.edges if word == "edge" else body.vertices
        if not 0 <= number < len(every):
            raise InputError(f"{where} is {number}; expected an index of one that body {body.name!r} has, {len(every)}")
        return every[number]
