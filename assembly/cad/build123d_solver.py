"""Joined parts of build123d as a scene of bodies without shapes, and the solve that moves them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from assembly.assembly import Assembly
from assembly.cad.build123d_joints import Tie, kind_of
from assembly.cad.build123d_parts import built, renew
from assembly.cad.libraries import is_of, shown
from assembly.cad.locations import location_of, pose_of
from assembly.errors import InputError, items
from assembly.kinematics.body import Body
from assembly.kinematics.pose import Pose
from assembly.solve.solution import Solution
from assembly.step.bodies import unique

__all__ = ["is_build123d", "solve_build123d"]

# What a driven value that is no mapping is of; of other joints the angle.
_DRIVEN = {"Linear": "position", "Ball": "angles"}


def is_build123d(thing: Any) -> bool:
    """Whether a thing is a part, a compound or a builder of build123d, which have joints, or several of them."""
    if isinstance(built(thing), (list, tuple)):
        return bool(thing) and all(is_build123d(one) for one in thing)
    return is_of("build123d", "Shape", built(thing)) and hasattr(built(thing), "joints")


@dataclass(frozen=True)
class _Part:
    """What joints move as a whole, and the name it has in the tree."""

    part: Any
    name: str


def _parts(thing: Any) -> list[_Part]:
    """The parts, and compounds, that have joints, and parts without."""
    thing = built(thing)
    if is_of("build123d", "Shape", thing):
        return list(_below(thing, "")) if thing.children else [_Part(thing, thing.label or "part")]
    taken: set[str] = set()
    found: list[_Part] = []
    for one in map(built, thing):
        name = unique(one.label or "part", taken)
        found += _below(one, name) if one.children and not one.joints else [_Part(one, name)]
    return found


def _below(compound: Any, path: str) -> Iterator[_Part]:
    names: set[str] = set()
    for child in compound.children:
        label = unique(child.label or "part", names)
        name = f"{path}/{label}" if path else label
        if child.children and not child.joints:
            yield from _below(child, name)
        else:
            yield _Part(child, name)


def _standing(parts: list[_Part], fixed: Any) -> set[int]:
    """Parts that do not move: those that are said, themselves or their names, or the first one."""
    if isinstance(fixed, str) or is_of("build123d", "Shape", fixed):
        fixed = [fixed]
    stays: set[int] = set()
    for one in items("fixed", fixed, "parts or their names"):
        found = [item for item in parts if item.part is built(one) or item.name == one]
        if not found:
            known = ", ".join(repr(item.name) for item in parts)
            raise InputError(f"fixed has {shown(one)}; expected parts of the assembly: {known}")
        stays.update(id(item.part) for item in found)
    return stays or {id(parts[0].part)}


def _by_joint(driven: Any) -> dict[int, dict[str, Any]]:
    """Driven values by the identity of the joint."""
    if not isinstance(driven, Mapping):
        raise TypeError(f"driven is {driven!r}; expected a mapping of joint to value")
    found: dict[int, dict[str, Any]] = {}
    for joint, value in driven.items():
        if not is_of("build123d", "Joint", joint):
            raise TypeError(f"driven has {shown(joint)}; expected joints of build123d")
        if not isinstance(value, Mapping):
            value = {_DRIVEN.get(kind_of(joint), "angle"): value}
        found[id(joint)] = dict(value)
    return found


def _ties(parts: list[_Part], bodies: Mapping[int, Body], driven: dict[int, dict[str, Any]]) -> list[Tie]:
    """What `connect_to` has tied."""
    ties, taken = [], set[str]()
    for item in parts:
        for joint in item.part.joints.values():
            other = joint.connected_to
            if other is None:
                continue
            body = bodies.get(id(built(other.parent)))
            if body is None:
                raise InputError(
                    f"joint {joint.label!r} of {item.name!r} is tied to a part that is not given; expected both"
                )
            name = unique(f"{item.name}.{joint.label}-{body.name}.{other.label}", taken)
            value = {**driven.pop(id(joint), {}), **driven.pop(id(other), {})}
            ties.append(Tie(joint, other, (bodies[id(item.part)], body), name, value))
    if not ties:
        raise InputError("no joints of the parts are tied; expected joint.connect_to(other)")
    if driven:
        raise InputError("driven has a joint that ties none of the parts; expected one that does")
    return ties


def solve_build123d(thing: Any, fixed: Any, driven: Any, options: dict[str, Any]) -> Solution:
    """Solve parts of build123d in place; see `assembly.cad.solve`."""
    parts = _parts(thing)
    stays = _standing(parts, fixed)
    bodies: dict[int, Body] = {}
    poses: dict[Body, Pose] = {}
    # Locations of parts in a tree are those in their compound, for joints as well.
    for item in parts:
        body = bodies[id(item.part)] = Body(item.name, fixed=id(item.part) in stays)
        poses[body] = body.pose = pose_of(item.part.wrapped.Location(), repr(item.name))
    ties = _ties(parts, bodies, _by_joint(driven))
    joints = [joint for tie in ties for joint in tie.joints()]
    for tie in ties:
        tie.begin(poses)
    scene = Assembly([*bodies.values(), *(body for tie in ties for body in tie.between)])
    scene.constrain(*joints)
    solution = scene.solve(**options)
    if solution.success:
        for item in parts:
            pose = solution.pose(bodies[id(item.part)])
            if (pose.q != poses[bodies[id(item.part)]].q).any():
                item.part.location = type(item.part.location)(location_of(pose))
        renew(thing)
    return solution
