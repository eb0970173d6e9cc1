"""What stands in a scene file of constraints and objectives: the fields of every kind. Others are not saved."""

from __future__ import annotations

from functools import partial
from operator import methodcaller
from typing import Any

from assembly.constraints.model.clearance import Clearance
from assembly.constraints.model.contact import Contact
from assembly.constraints.model.contact_place import ContactPlace
from assembly.constraints.model.couplings import Gear, Linear, RackPinion
from assembly.constraints.model.dexterity import Dexterity
from assembly.constraints.model.expression import Expression
from assembly.constraints.model.groups import Group, Symmetric
from assembly.constraints.model.joints import (
    ConstantVelocity,
    Cylindrical,
    Fixed,
    Parallel,
    Perpendicular,
    Planar,
    Prismatic,
    Revolute,
    Screw,
    Spherical,
    Universal,
)
from assembly.constraints.model.mate_features import Mate
from assembly.constraints.model.mates import Coaxial, Concentric, Flush, Insert, Width
from assembly.constraints.model.objectives import FrameDistance, PointDistance, Posture, Weight
from assembly.constraints.model.placements import Angle, Distance, PointOnLine, PointOnPlane
from assembly.constraints.model.tangent import ContactTangent, SurfaceTangent, Tangent
from assembly.constraints.model.trim_contact import TrimContact, single_face
from assembly.errors import InputError
from assembly.geometry.faces.loop import Loop
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame, Point
from assembly.scene_file.body_kinds import FRAME, LOOP, NAME, NUMBER, NUMBERS, POSE, VECTOR
from assembly.scene_file.features import Feature
from assembly.scene_file.fields import bad, each, flag, number, or_null, table, text, whole
from assembly.scene_file.records import Field, Listed, OneOf, OrNull, Parts, Plain, Record
from assembly.scene_file.references import BODY_NAME, CONSTRAINT_NAME, CONTACT_NAME, FREEDOM, SIDE

__all__ = ["CONSTRAINTS", "OBJECTIVES"]


class _TrimLoop:
    """The loop of a trim: one of its face, "outer" or the index of a hole, or a loop of its own."""

    def write(self, path: str, value: TrimContact, parts: Parts) -> Any:
        if value.loop is value.face.outer:
            return "outer"
        for k, hole in enumerate(value.face.holes):
            if value.loop is hole:
                return k
        return LOOP.write(path, value.loop, parts)

    def read(self, path: str, value: Any, parts: Parts) -> Any:
        if isinstance(value, dict):
            return LOOP.read(path, value, parts)
        if value == "outer":
            return value
        if isinstance(value, bool) or not isinstance(value, int):
            raise bad(path, value, '"outer", the index of a hole, or an object with the fields tolerance, curves')
        return value


def _trim(contact: Contact, side: str, loop: Loop | str | int, **others: Any) -> TrimContact:
    """A trim; a loop of the face is the face's own, by which it is known."""
    if not isinstance(loop, Loop):
        face = single_face(side, contact.a if side == "a" else contact.b)
        if loop == "outer":
            if face.outer is None:
                raise InputError('loop is "outer"; expected another, for that of the face is the edge of its surface')
            loop = face.outer
        elif isinstance(loop, int) and 0 <= loop < len(face.holes):
            loop = face.holes[loop]
        else:
            raise InputError(f"loop is {loop}; expected an index of one of {len(face.holes)} holes of the face")
    return TrimContact(contact, loop, side=side, **others)  # type: ignore[arg-type]  # words are checked there


def _read_limits(path: str, value: Any) -> list[float | None]:
    return each(path, value, or_null(number), 2)


def _read_side(path: str, value: Any) -> str:
    side = text(path, value)
    if side not in ("a", "b"):
        raise bad(path, side, '"a" or "b"')
    return side


def _read_axes_of_task(path: str, value: Any) -> str | list[str]:
    return each(path, value, text, 2) if isinstance(value, list) else text(path, value)


def _free(*names: str) -> tuple[Field, ...]:
    """Driven values and limits of coordinates; with one coordinate its limits have no name of their own."""
    limits = ["limits"] if len(names) == 1 else [f"{name}_limits" for name in names]
    return tuple(
        made for name, its in zip(names, limits, strict=True) for made in (Field(name, DRIVEN), Field(its, LIMITS))
    )


def _features(*names: str) -> tuple[Field, ...]:
    """What a mate ties, by the names of its arguments."""
    return tuple(Field(name, FEATURE, partial(_given, name)) for name in names)


def _given(name: str, mate: Mate) -> Any:
    return mate._given[name]


def _clearance(neglect: float, places: int | None, **others: Any) -> Clearance:
    """Files have the former names of two options."""
    return Clearance(merge_radius=neglect, slots=places, **others)


def _point_distance(body: Body, point: list[float], target: list[float], weight: float) -> PointDistance:
    return PointDistance(body.point(*point), target, weight)


DRIVEN = Plain(or_null(number))
LIMITS = Plain(or_null(_read_limits), lambda limits: None if limits is None else list(limits))
LINES = Plain(
    lambda path, value: "\n".join(each(path, value, text)),
    lambda document: document.splitlines(),
)

UNILATERAL = Field("unilateral", Plain(flag))
# Of what is never one-sided as well.
UNILATERAL_OR_NOT = Field("unilateral", Plain(flag), lambda item: getattr(item, "unilateral", False))
WEIGHT = Field("weight", NUMBER)
FRAMES = (Field("frame_a", FRAME), Field("frame_b", FRAME))
POINTS = (Field("point_a", FRAME, "frame_a"), Field("point_b", FRAME, "frame_b"))
# Of a point on a line or a plane, frame a is that of the line or the plane.
POINT_AND_FRAME = (Field("point", FRAME, "frame_b"), Field("frame", FRAME, "frame_a"))
AXES = Field("axes", Plain(text), "asked_axes")
OFFSET = Field("offset", NUMBER)
FEATURE = Feature(FRAME)
HELD = (Field("value", DRIVEN), Field("limits", LIMITS))

EXPRESSION = Record(
    Expression,
    NAME,
    Field("bodies", Listed(BODY_NAME)),
    Field("function", LINES, methodcaller("document"), "document"),
    UNILATERAL,
    Field("scale", NUMBER),
    WEIGHT,
    make=Expression.from_document,
)
PLACE = Record(
    ContactPlace,
    NAME,
    Field("contact", CONTACT_NAME),
    Field("side", Plain(_read_side), lambda place: "ab"[place.side]),
    Field("target", Plain(lambda path, value: each(path, value, or_null(number), 2), list)),
    WEIGHT,
)


CONSTRAINTS = OneOf(
    {
        "contact": Record(
            Contact,
            NAME,
            Field("a", SIDE),
            Field("b", SIDE),
            UNILATERAL,
            Field("edges", Plain(flag), since=2),
            Field("minimum", NUMBER, since=5),
        ),
        "fixed": Record(Fixed, NAME, *FRAMES, AXES),
        "revolute": Record(Revolute, NAME, *FRAMES, AXES, *_free("angle")),
        "prismatic": Record(Prismatic, NAME, *FRAMES, AXES, *_free("slide")),
        "cylindrical": Record(Cylindrical, NAME, *FRAMES, AXES, *_free("angle", "slide")),
        "screw": Record(Screw, NAME, *FRAMES, Field("pitch", NUMBER), AXES, *_free("angle", "slide")),
        "planar": Record(Planar, NAME, *FRAMES, AXES, OFFSET, *_free("x", "y", "angle")),
        "constant_velocity": Record(ConstantVelocity, NAME, *FRAMES, AXES, *_free("swing", "azimuth")),
        "spherical": Record(Spherical, NAME, *FRAMES, *_free("swing", "azimuth", "twist")),
        "universal": Record(Universal, NAME, *FRAMES, *_free("angle_a", "angle_b")),
        "parallel": Record(Parallel, NAME, *FRAMES, AXES, *_free("angle")),
        "perpendicular": Record(Perpendicular, NAME, *FRAMES),
        "point_on_line": Record(
            PointOnLine,
            NAME,
            *POINT_AND_FRAME,
            *_free("slide"),
            Field("distance", DRIVEN, since=4),
            Field("distance_limits", LIMITS, since=4),
        ),
        "point_on_plane": Record(PointOnPlane, NAME, *POINT_AND_FRAME, OFFSET, *_free("x", "y")),
        "distance": Record(Distance, NAME, *POINTS, *HELD),
        "angle": Record(Angle, NAME, *FRAMES, *HELD),
        "gear": Record(
            Gear, NAME, Field("a", FREEDOM, "leader"), Field("b", FREEDOM, "follower"), Field("ratio", NUMBER), OFFSET
        ),
        "linear": Record(
            Linear, NAME, Field("a", FREEDOM, "leader"), Field("b", FREEDOM, "follower"), Field("ratio", NUMBER), OFFSET
        ),
        "rack_pinion": Record(
            RackPinion,
            NAME,
            Field("pinion", FREEDOM, "leader"),
            Field("rack", FREEDOM, "follower"),
            Field("radius", NUMBER),
            OFFSET,
        ),
        "trim_contact": Record(
            TrimContact,
            NAME,
            Field("contact", CONTACT_NAME),
            Field("side", Plain(_read_side), lambda trim: "ab"[trim.side]),
            Field("loop", _TrimLoop(), lambda trim: trim),
            Field("keep", Plain(text)),
            Field("form", Plain(text)),
            make=_trim,
        ),
        "contact_place": PLACE,
        "flush": Record(Flush, NAME, *_features("face_a", "face_b"), AXES, OFFSET, *_free("x", "y", "angle")),
        "coaxial": Record(Coaxial, NAME, *_features("a", "b"), AXES, *_free("angle", "slide")),
        "insert": Record(
            Insert,
            NAME,
            *_features("hole", "shank"),
            Field("seats", Listed(FEATURE), lambda mate: mate.seats[:2]),
            AXES,
            OFFSET,
            *_free("angle"),
        ),
        "concentric": Record(Concentric, NAME, *_features("a", "b"), *_free("swing", "azimuth", "twist")),
        "width": Record(
            Width,
            NAME,
            Field("slot", Listed(FEATURE), lambda mate: mate.features[0]),
            Field("tab", Listed(FEATURE), lambda mate: mate.features[1]),
            AXES,
            OFFSET,
            *_free("x", "y", "angle"),
        ),
        "tangent": Record(
            (Tangent, SurfaceTangent, ContactTangent),
            NAME,
            Field("a", FEATURE, lambda mate: mate.faces[0]),
            Field("b", FEATURE, lambda mate: mate.faces[1]),
            Field("side", Plain(text)),
            UNILATERAL_OR_NOT,
            Field("touch", Plain(or_null(text)), since=4),
        ),
        "symmetric": Record(Symmetric, NAME, *_features("a", "b", "plane")),
        "group": Record(Group, NAME, Field("bodies", Listed(BODY_NAME)), Field("poses", Listed(POSE))),
        "clearance": Record(
            Clearance,
            NAME,
            Field(
                "bodies", OrNull(Listed(BODY_NAME)), lambda clearance: None if clearance.is_of_all else clearance.bodies
            ),
            Field("minimum", NUMBER),
            Field("exclude", Listed(Listed(BODY_NAME))),
            Field("neglect", NUMBER, "merge_radius"),
            Field("places", Plain(or_null(whole)), "slots"),
            make=_clearance,
        ),
        "expression": EXPRESSION,
    }
)


def _tip_frame(dexterity: Dexterity) -> Frame:
    """The tip as a frame; its task tells which of its velocities count."""
    tip = dexterity.tip_task.tip
    return tip.body.frame(at=tip.coordinates) if isinstance(tip, Point) else tip


OBJECTIVES = OneOf(
    {
        "point_distance": Record(
            PointDistance,
            WEIGHT,
            Field("body", BODY_NAME, "point.body"),
            Field("point", VECTOR, "point.coordinates"),
            Field("target", NUMBERS),
            make=_point_distance,
        ),
        "frame_distance": Record(
            FrameDistance, WEIGHT, Field("frame", FRAME), Field("target", POSE), Field("length", NUMBER)
        ),
        "posture": Record(
            Posture,
            WEIGHT,
            Field("reference", Plain(or_null(table(2)), lambda rows: None if rows is None else rows.tolist())),
        ),
        "weight": Record(Weight, WEIGHT, Field("bodies", Listed(BODY_NAME)), Field("direction", NUMBERS)),
        "dexterity": Record(
            Dexterity,
            WEIGHT,
            Field("tip", FRAME, _tip_frame),
            Field("inputs", Listed(FREEDOM), "tip_task.inputs"),
            Field("measure", Plain(text)),
            Field("task", Plain(text), "tip_task.task"),
            Field("length", NUMBER, "tip_task.length"),
            Field("direction", Plain(or_null(table(1)), lambda u: None if u is None else u.tolist())),
            Field(
                "axes",
                Plain(_read_axes_of_task, lambda axes: list(axes) if isinstance(axes, tuple) else axes),
                "tip_task.axes",
                since=5,
            ),
            Field("ignoring", Listed(CONSTRAINT_NAME), "tip_task.ignoring", since=5),
            Field("holding", Listed(CONSTRAINT_NAME), "tip_task.holding", since=5),
        ),
        "contact_place": PLACE,
        "expression": EXPRESSION,
    }
)
