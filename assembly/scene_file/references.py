"""How things of a scene file refer to others: to surfaces and faces by their index, to the rest by name."""

from __future__ import annotations

from typing import Any

from assembly.constraints.model.constraint import Constraint, Freedom
from assembly.constraints.model.contact import Contact
from assembly.constraints.model.joint import Joint
from assembly.errors import InputError
from assembly.kinematics.body import Body, BodyFace
from assembly.scene_file.fields import at, bad, members, or_null, text, whole
from assembly.scene_file.records import Parts, Record

__all__ = ["BODY_NAME", "CONSTRAINT_NAME", "CONTACT_NAME", "FREEDOM", "SIDE", "Index", "refers_to_others"]


class Index:
    """The index in a table of the file, so that a surface or a face that many things share is there once."""

    def __init__(self, table: str) -> None:
        self._table = table

    def write(self, path: str, value: Any, parts: Parts) -> int:
        """The index of a value, which is added to the table where it is new."""
        return parts.index(getattr(parts, self._table), value)

    def read(self, path: str, value: Any, parts: Parts) -> Any:
        """The value at an index."""
        table: list[Any] = getattr(parts, self._table)
        index = whole(path, value)
        if not 0 <= index < len(table):
            raise bad(path, index, f"an index of one of {len(table)} {self._table}")
        return table[index]


class _BodyName:
    """A body of the scene by its name."""

    def write(self, path: str, value: Body, parts: Parts) -> str:
        return value.name

    def read(self, path: str, value: Any, parts: Parts) -> Body:
        name = text(path, value)
        with at(path):
            return parts.scene.body(name)


class _Side:
    """A face of a body, or the body."""

    def write(self, path: str, value: Body | BodyFace, parts: Parts) -> dict[str, Any]:
        if isinstance(value, Body):
            return {"body": value.name, "face": None}
        return {"body": value.body.name, "face": value.name}

    def read(self, path: str, value: Any, parts: Parts) -> Body | BodyFace:
        body_name, face_name = members(path, value, ("body", "face"))
        body = BODY_NAME.read(f"{path}.body", body_name, parts)
        label = or_null(text)(f"{path}.face", face_name)
        if label is None:
            return body
        with at(f"{path}.face"):
            return body.face(label)


class _Freedom:
    """A coordinate of a joint of the same file."""

    def write(self, path: str, value: Freedom, parts: Parts) -> dict[str, Any]:
        joint = value.joint
        if parts.constraints.get(joint.name) is not joint:
            raise InputError(
                f"{path} is freedom {value.name!r} of joint {joint.name!r}, which is not in the assembly; "
                "expected a joint that scene.constrain was given, for files refer to joints by name"
            )
        return {"joint": joint.name, "freedom": value.name}

    def read(self, path: str, value: Any, parts: Parts) -> Freedom:
        joint_name, freedom_name = members(path, value, ("joint", "freedom"))
        joint: Joint = _of_the_file(Joint, "joint", f"{path}.joint", joint_name, parts)
        label = text(f"{path}.freedom", freedom_name)
        with at(f"{path}.freedom"):
            return joint.freedom(label)


class _ConstraintName:
    """A constraint of the same file by its name."""

    def write(self, path: str, value: Constraint, parts: Parts) -> str:
        if parts.constraints.get(value.name) is not value:
            raise InputError(f"{path} is {value.name!r}, which is not in the assembly; expected scene.constrain of it")
        return value.name

    def read(self, path: str, value: Any, parts: Parts) -> Constraint:
        constraint: Constraint = _of_the_file(Constraint, "constraint", path, value, parts)
        return constraint


class _ContactName:
    """A contact of the same file by its name."""

    def write(self, path: str, value: Contact, parts: Parts) -> str:
        return value.name

    def read(self, path: str, value: Any, parts: Parts) -> Contact:
        contact: Contact = _of_the_file(Contact, "contact", path, value, parts)
        return contact


def _of_the_file(kind: type, word: str, path: str, value: Any, parts: Parts) -> Any:
    """A constraint of a kind by its name."""
    name = text(path, value)
    found = parts.constraints.get(name)
    if not isinstance(found, kind):
        names = [repr(known) for known, item in parts.constraints.items() if isinstance(item, kind)]
        known = ", ".join(names) or f"none, the file has no {word}s"
        raise bad(path, name, f"a {word} of the file: {known}")
    return found


BODY_NAME = _BodyName()
SIDE = _Side()
FREEDOM = _Freedom()
CONTACT_NAME = _ContactName()
CONSTRAINT_NAME = _ConstraintName()


def refers_to_others(record: Record) -> bool:
    """Whether a thing can only be made when joints and contacts are there."""
    return any(item.form is FREEDOM or item.form is CONTACT_NAME for item in record.fields)
