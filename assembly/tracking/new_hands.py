"""The hands that a tracker begins with, and the scene with their springs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from assembly.assembly import Assembly
from assembly.constraints.model.constraint import Freedom
from assembly.constraints.model.coordinate_distance import checked_coordinate
from assembly.errors import InputError, positive
from assembly.kinematics.body import Body
from assembly.kinematics.frame import Frame, Point
from assembly.tracking.coordinate_hand import CoordinateHand
from assembly.tracking.hands import Followable, Hand, Hands, SeveralHands

__all__ = ["new_hands", "springs", "with_hands"]

Array = NDArray[np.float64]


def springs(follow: Followable | Sequence[Followable], stiffness: float | Sequence[float]) -> list[float]:
    """Weights of the terms of what hands hold: half their stiffness.

    Raises
    ------
    InputError, TypeError
        Nothing held, something that cannot be, or not one stiffness for all or for each.
    """
    if not isinstance(follow, (list, tuple)):
        if not isinstance(follow, (Point, Frame, Body, Freedom)):
            raise TypeError(
                f"follow is {follow!r}; expected a Point, a Frame, a Body, a joint's coordinate or a list of them"
            )
        return [0.5 * positive("stiffness", stiffness)]
    if not follow:
        raise InputError("follow is empty; expected a Point, a Frame, a Body or a joint's coordinate at least")
    for k, held in enumerate(follow):
        if not isinstance(held, (Point, Frame, Body, Freedom)):
            raise TypeError(f"follow[{k}] is {held!r}; expected a Point, a Frame, a Body or a joint's coordinate")
    if not isinstance(stiffness, (list, tuple, np.ndarray)) or np.ndim(stiffness) == 0:
        return [0.5 * positive("stiffness", stiffness)] * len(follow)
    if len(stiffness) != len(follow):
        raise InputError(
            f"stiffness has {len(stiffness)} numbers; expected one, or one for each of {len(follow)} hands"
        )
    return [0.5 * positive(f"stiffness[{k}]", value) for k, value in enumerate(stiffness)]


def new_hands(
    scene: Assembly, follow: Followable | Sequence[Followable], poses: Array, weights: Sequence[float]
) -> Hands:
    """The hands that hold bodies of a scene, which are at poses (n, 7), and coordinates of its joints.

    Raises
    ------
    InputError
        A body that is not of the scene or does not move; a coordinate of another scene's joint, or one that is driven,
        or neither an angle about an axis nor a way along one.
    """
    several = not isinstance(follow, (Point, Frame, Body, Freedom))
    held = [follow] if isinstance(follow, (Point, Frame, Body, Freedom)) else list(follow)
    hands: list[Hand] = []
    for k, (item, weight) in enumerate(zip(held, weights, strict=True)):
        name = f"follow[{k}]" if several else "follow"
        if isinstance(item, Freedom):
            hands.append(_on_coordinate(scene, name, item, poses, weight))
        else:
            place = _place_of(scene, name, item)
            hands.append(Hand(item, place, poses[place], weight))
    return SeveralHands(hands) if several else hands[0]


def _place_of(scene: Assembly, name: str, item: Point | Frame | Body) -> int:
    """The number of a body that is held."""
    body, bodies = item if isinstance(item, Body) else item.body, scene.bodies
    if body not in bodies:
        raise InputError(f"{name} is of body {body.name!r}; expected one of {[body.name for body in bodies]}")
    if body.fixed:
        raise InputError(f"{name} is of body {body.name!r}, which is fixed; expected a body that moves")
    return bodies.index(body)


def _on_coordinate(scene: Assembly, name: str, freedom: Freedom, poses: Array, weight: float) -> CoordinateHand:
    joint = freedom.joint
    if joint not in scene.constraints:
        raise InputError(f"{name} is of joint {joint.name!r}, which is not in the scene; expected one that is")
    checked_coordinate(name, freedom)
    return CoordinateHand(freedom, [scene.bodies.index(body) for body in joint.bodies], poses, weight)


def with_hands(scene: Assembly, hands: Hands) -> Assembly:
    """The same scene with the hands' springs among its objectives."""
    inner = Assembly(scene.bodies)
    inner._take_constraints(scene.constraints)
    for sign, objective in scene.objectives:
        (inner.minimize if sign > 0.0 else inner.maximize)(objective)
    inner.minimize(*hands.terms)
    # Solids that lie on each other go on doing so.
    inner._corners = scene._corners
    return inner
