"""Joints: what each requires of two frames, and what it leaves free.

Rows and joint coordinates describe frame b as seen from frame a (kinds as in `constraints/program/primitives.py`);
both z
axes are the joint's axes. Lengths are in the user's unit, angles in radians. Every coordinate takes a driven value and
limits (lower, upper), in the call and between solves:

    crank = asm.Revolute(ground.frame(), arm.frame(), angle=0.2)
    crank.angle = 0.3               # driven elsewhere
    crank.angle = None              # free
    crank.limits = (-1.0, 1.0)      # kept within

`Joint` documents the arguments that all joints share.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import ClassVar

from assembly.constraints.model.constraint import Coordinate, Equation, FramePair
from assembly.constraints.model.joint import (
    ON_AXIS,
    SAME_AXIS,
    SAME_POINT,
    Axes,
    Driven,
    Joint,
    Limits,
    Offset,
    Side,
    SidePoint,
)
from assembly.constraints.program.primitives import ANGLE, AZIMUTH, DOT, SLIDE, TURN
from assembly.errors import InputError, bounded

__all__ = [
    "ConstantVelocity",
    "Cylindrical",
    "Fixed",
    "Parallel",
    "Perpendicular",
    "Planar",
    "Prismatic",
    "Revolute",
    "Screw",
    "Spherical",
    "Universal",
]

Number = float | None
Range = Sequence[float | None] | None

ALONG = (SLIDE, 2)
TWIST = (TURN, 0)
Z_DOT_Z = (DOT, 8)
Z_AZIMUTH = (AZIMUTH, 2)


class Fixed(Joint):
    """The two frames coincide: 6 rows, nothing free.

    Origins coincide (3), z axes lie along each other (2), no turn about them (1). Opposed, the z and the y axes point
    against each other and the x axes the same way.
    """

    _zero = (*SAME_POINT, *SAME_AXIS, TWIST)

    def __init__(self, frame_a: Side, frame_b: Side, name: str | None = None, *, axes: Axes = "aligned") -> None:
        super().__init__(frame_a, frame_b, name, axes)


class Revolute(Joint):
    """A hinge: 5 rows, free to turn.

    Origins coincide (3) and z axes lie along each other (2). Free: `angle`, from x_a to x_b about z_a.
    """

    _zero: ClassVar[tuple[tuple[int, int], ...]] = (*SAME_POINT, *SAME_AXIS)
    _free = {"angle": TWIST}
    angle = Driven("angle", "turn of x_b from x_a about z_a [rad]")
    limits = Limits("angle")

    def __init__(
        self,
        frame_a: Side,
        frame_b: Side,
        name: str | None = None,
        *,
        axes: Axes = "aligned",
        angle: Number = None,
        limits: Range = None,
    ) -> None:
        super().__init__(frame_a, frame_b, name, axes, angle=(angle, limits))


class Prismatic(Joint):
    """A slider: 5 rows, free to slide.

    Frame b keeps its orientation (3) and its origin stays on the z axis of frame a (2). Free: `slide` along z_a.
    """

    _zero = (*ON_AXIS, *SAME_AXIS, TWIST)
    _free = {"slide": ALONG}
    slide = Driven("slide", "origin of b along z_a")
    limits = Limits("slide")

    def __init__(
        self,
        frame_a: Side,
        frame_b: Side,
        name: str | None = None,
        *,
        axes: Axes = "aligned",
        slide: Number = None,
        limits: Range = None,
    ) -> None:
        super().__init__(frame_a, frame_b, name, axes, slide=(slide, limits))


class Cylindrical(Joint):
    """A shaft in a sleeve: 4 rows, free to turn and to slide.

    The origin of frame b stays on the z axis of frame a (2), z axes lie along each other (2). Free: `angle` about
    z_a and `slide` along it.
    """

    _zero = (*ON_AXIS, *SAME_AXIS)
    _free = {"angle": TWIST, "slide": ALONG}
    angle = Driven("angle", "turn of x_b from x_a about z_a [rad]")
    slide = Driven("slide", "origin of b along z_a")
    angle_limits = Limits("angle")
    slide_limits = Limits("slide")

    def __init__(
        self,
        frame_a: Side,
        frame_b: Side,
        name: str | None = None,
        *,
        axes: Axes = "aligned",
        angle: Number = None,
        slide: Number = None,
        angle_limits: Range = None,
        slide_limits: Range = None,
    ) -> None:
        super().__init__(frame_a, frame_b, name, axes, angle=(angle, angle_limits), slide=(slide, slide_limits))


class Screw(Cylindrical):
    """A nut on a screw: 5 rows, free to turn, sliding as it turns.

    The rows of `Cylindrical` (4) and slide - pitch angle / (2 pi) = 0. Coordinates: `angle` and `slide`, of which one
    follows from the other; drive one of them.

    Parameters
    ----------
    pitch : float
        Travel along z_a per turn; not zero, negative for a left-handed screw.
    """

    def __init__(
        self,
        frame_a: Side,
        frame_b: Side,
        pitch: float,
        name: str | None = None,
        *,
        axes: Axes = "aligned",
        angle: Number = None,
        slide: Number = None,
        angle_limits: Range = None,
        slide_limits: Range = None,
    ) -> None:
        self._pitch = bounded("pitch", pitch)
        if self._pitch == 0.0:
            raise InputError(
                "pitch is 0; expected the travel per turn, not zero; a nut that cannot slide is a Revolute"
            )
        super().__init__(
            frame_a,
            frame_b,
            name,
            axes=axes,
            angle=angle,
            slide=slide,
            angle_limits=angle_limits,
            slide_limits=slide_limits,
        )
        slides, turns = self._freedoms["slide"].coordinate, self._freedoms["angle"].coordinate
        self._own = (*self._own, Equation(((1.0, slides), (-self._pitch / (2.0 * pi), turns))))

    @property
    def pitch(self) -> float:
        """Travel along z_a per turn."""
        return self._pitch


class Planar(Joint):
    """One plane on another: 3 rows, free to move in the plane and to turn in it.

    z axes lie along each other (2), the origin of frame b is at height `offset` above the x-y plane of frame a (1).
    Free: `x` and `y` along the axes of frame a, `angle` about z_a.
    """

    _zero = SAME_AXIS
    _free = {"x": (SLIDE, 0), "y": (SLIDE, 1), "angle": TWIST}
    x = Driven("x", "origin of b along x_a")
    y = Driven("y", "origin of b along y_a")
    angle = Driven("angle", "turn of x_b from x_a about z_a [rad]")
    x_limits = Limits("x")
    y_limits = Limits("y")
    angle_limits = Limits("angle")
    offset = Offset("Height of the origin of b above the x-y plane of a.")

    def __init__(
        self,
        frame_a: Side,
        frame_b: Side,
        name: str | None = None,
        *,
        axes: Axes = "aligned",
        offset: float = 0.0,
        x: Number = None,
        y: Number = None,
        angle: Number = None,
        x_limits: Range = None,
        y_limits: Range = None,
        angle_limits: Range = None,
    ) -> None:
        super().__init__(frame_a, frame_b, name, axes, x=(x, x_limits), y=(y, y_limits), angle=(angle, angle_limits))
        self.offset = offset
        self._own = (*self._own, Equation(((1.0, self._coordinate(*ALONG)),), (self, "offset")))


class Spherical(Joint):
    """A ball in a socket: 3 rows, free to turn every way.

    Origins coincide; of a point or a body the axes are the body's. Coordinates: `swing`, the angle between the z axes,
    `azimuth`, the direction of z_b about z_a from x_a, and `twist`, the turn of x_b from x_a about z_a. The azimuth
    has no value where the swing is 0, the twist none where it is pi. A cone is `swing_limits=(None, half_angle)`.
    """

    _zero = SAME_POINT
    _free = {"swing": (ANGLE, 0), "azimuth": Z_AZIMUTH, "twist": TWIST}
    _points = (True, True)
    swing = Driven("swing", "angle between z_a and z_b [rad], between 0 and pi")
    azimuth = Driven("azimuth", "direction of z_b about z_a, from x_a [rad]")
    twist = Driven("twist", "turn of x_b from x_a about z_a [rad]")
    swing_limits = Limits("swing")
    azimuth_limits = Limits("azimuth")
    twist_limits = Limits("twist")

    def __init__(
        self,
        frame_a: SidePoint,
        frame_b: SidePoint,
        name: str | None = None,
        *,
        swing: Number = None,
        azimuth: Number = None,
        twist: Number = None,
        swing_limits: Range = None,
        azimuth_limits: Range = None,
        twist_limits: Range = None,
    ) -> None:
        super().__init__(
            frame_a,
            frame_b,
            name,
            swing=(swing, swing_limits),
            azimuth=(azimuth, azimuth_limits),
            twist=(twist, twist_limits),
        )


class Universal(Joint):
    """A Cardan joint: 4 rows, free to turn about the z axis of either frame.

    Origins coincide (3), the z axes, which are the arms of the cross, are perpendicular (1). Free: `angle_a`, the
    direction of z_b about z_a from x_a, and `angle_b`, the direction of z_a about z_b from x_b.
    """

    _zero = (*SAME_POINT, Z_DOT_Z)
    _free = {"angle_a": Z_AZIMUTH, "angle_b": Z_AZIMUTH}
    angle_a = Driven("angle_a", "direction of z_b about z_a, from x_a [rad]")
    angle_b = Driven("angle_b", "direction of z_a about z_b, from x_b [rad]")
    angle_a_limits = Limits("angle_a")
    angle_b_limits = Limits("angle_b")

    def __init__(
        self,
        frame_a: Side,
        frame_b: Side,
        name: str | None = None,
        *,
        angle_a: Number = None,
        angle_b: Number = None,
        angle_a_limits: Range = None,
        angle_b_limits: Range = None,
    ) -> None:
        super().__init__(frame_a, frame_b, name, angle_a=(angle_a, angle_a_limits), angle_b=(angle_b, angle_b_limits))

    def _free_coordinate(self, freedom: str) -> Coordinate:
        frames = self._frames if freedom == "angle_a" else FramePair(self._frames.frame_b, self._frames.frame_a)
        return Coordinate(*self._free[freedom], frames)


class ConstantVelocity(Joint):
    """A constant-velocity joint, as ball bearings in grooves make one: 4 rows, free to bend every way.

    Origins coincide (3), and the one shaft turns about its axis as the other does about its own (1), however far the
    axes are bent: the twist is zero. Free: `swing`, the angle between the z axes, and `azimuth`, the direction of z_b
    about z_a from x_a, which has no value where the swing is 0.
    """

    _zero = (*SAME_POINT, TWIST)
    _free = {"swing": (ANGLE, 0), "azimuth": Z_AZIMUTH}
    swing = Driven("swing", "angle between the z axes [rad]")
    azimuth = Driven("azimuth", "direction of z_b about z_a, from x_a [rad]")
    swing_limits = Limits("swing")
    azimuth_limits = Limits("azimuth")

    def __init__(
        self,
        frame_a: Side,
        frame_b: Side,
        name: str | None = None,
        *,
        axes: Axes = "aligned",
        swing: Number = None,
        azimuth: Number = None,
        swing_limits: Range = None,
        azimuth_limits: Range = None,
    ) -> None:
        super().__init__(frame_a, frame_b, name, axes, swing=(swing, swing_limits), azimuth=(azimuth, azimuth_limits))


class Parallel(Joint):
    """z axes lie along each other: 2 rows, free to move every way and to turn about the axes.

    Free with a name: `angle`, from x_a to x_b about z_a.
    """

    _zero = SAME_AXIS
    _free = {"angle": TWIST}
    angle = Driven("angle", "turn of x_b from x_a about z_a [rad]")
    limits = Limits("angle")

    def __init__(
        self,
        frame_a: Side,
        frame_b: Side,
        name: str | None = None,
        *,
        axes: Axes = "aligned",
        angle: Number = None,
        limits: Range = None,
    ) -> None:
        super().__init__(frame_a, frame_b, name, axes, angle=(angle, limits))


class Perpendicular(Joint):
    """z axes are perpendicular: 1 row, z_a . z_b = 0; no coordinate with a name."""

    _zero = (Z_DOT_Z,)

    def __init__(self, frame_a: Side, frame_b: Side, name: str | None = None) -> None:
        super().__init__(frame_a, frame_b, name)
