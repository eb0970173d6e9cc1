"""Links and joints of a mechanism.

A body without a shape is drawn as rods between the places where it is held or drawn: the origins of its joints'
frames and the points that objectives name. A joint is a ball, and an arrow along each z axis that its rows speak of:
none for Spherical and Distance, one for Revolute, two for Universal.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from assembly.assembly import Assembly
from assembly.constraints.model.joint import Joint
from assembly.constraints.model.objectives import PointDistance
from assembly.constraints.model.tangent import Tangent
from assembly.constraints.program.primitives import COINCIDENT, DISTANCE, RADIUS, SLIDE
from assembly.kinematics.body import Body
from assembly.view.item import Color, Item, Place, Stations
from assembly.view.marks import arrow, ball, rods, stick
from assembly.view.mesh import Mesh
from assembly.view.motion import aligned
from assembly.view.style import Style

__all__ = [
    "COLOR",
    "JOINT",
    "MARK",
    "fineness",
    "held_points",
    "joint_items",
    "joint_tips",
    "line",
    "link_mesh",
    "said_value",
]

Array = NDArray[np.float64]
# Sizes in parts of the scene's radius: radii of marks, rods and joints, reach of arrows behind and before their origin.
MARK = 0.014
_ROD = 0.014
JOINT = 0.022
_BACK, _FORTH = -0.07, 0.14
# Links shorter than the first, in parts of the scene's radius, have thinner rods and joints, down to the second factor.
_SHORT, _LEAST = 0.12, 0.15
COLOR: Color = (0.20, 0.22, 0.27)
# Points of a body that differ by less, in parts of their distance from its origin, are one.
_COINCIDENT = 1e-9
# Directions that differ by less [rad] look the same.
_PARALLEL = 0.02


def _joints(scene: Assembly) -> list[Joint]:
    """Joints but tangents: what these ask of frames is not where their faces touch."""
    return [item for item in scene.constraints if isinstance(item, Joint) and not isinstance(item, Tangent)]


def held_points(scene: Assembly) -> dict[Body, Array]:
    """Points (m, 3) of each body without a shape where joints hold it or objectives draw it, in body coordinates.

    Where they are all one, the body's origin is another.
    """
    found: dict[Body, list[Array]] = {body: [] for body in scene.bodies if not body.faces}
    frames = [frame for joint in _joints(scene) for frame in (joint.frame_a, joint.frame_b)]
    points = [objective.point for _, objective in scene.objectives if isinstance(objective, PointDistance)]
    for body, coordinates in [*((f.body, f.origin) for f in frames), *((p.body, p.coordinates) for p in points)]:
        if body in found:
            found[body].append(coordinates)
    for places in found.values():
        if places and np.ptp(places, axis=0).max() <= _COINCIDENT * np.abs(places).max():
            places.append(np.zeros(3))
    return {body: np.array(places).reshape(-1, 3) for body, places in found.items()}


def fineness(scene: Assembly, held: dict[Body, Array], radius: float) -> float:
    """Factor of the sizes of rods and joints: 1, or less where links are short beside the scene's radius."""
    linked = dict.fromkeys(body for joint in _joints(scene) for body in joint.bodies)
    sizes = [body.size if body.faces else float(np.linalg.norm(np.ptp(held[body], axis=0))) for body in linked]
    sizes = [size for size in sizes if size > 0.0]
    return float(np.clip(np.median(sizes) / (_SHORT * radius), _LEAST, 1.0)) if sizes else 1.0


def link_mesh(points: Array, size: float) -> Mesh:
    """A body that is held at points (m, 3), one at least, in parts of the scene's radius about the body's origin.

    Up to three points are joined with each other, more as a tree of the shortest rods.
    """
    radius = size * _ROD
    apart = [p for k, p in enumerate(points) if (np.linalg.norm(points[:k] - p, axis=1) > radius).all()]
    places = np.array(apart)
    every = list(combinations(range(len(places)), 2))
    return rods(places, every if len(places) <= 3 else _tree(places), radius)


def _tree(points: Array) -> list[tuple[int, int]]:
    """Pairs of points whose rods connect them all with the least length (Prim's algorithm)."""
    nearest = np.linalg.norm(points - points[0], axis=1)
    nearest[0] = np.inf
    neighbor = np.zeros(len(points), dtype=np.int64)
    pairs: list[tuple[int, int]] = []
    reached = {0}
    while len(reached) < len(points):
        new = int(nearest.argmin())
        pairs.append((int(neighbor[new]), new))
        reached.add(new)
        distance = np.linalg.norm(points - points[new], axis=1)
        nearer = distance < nearest
        nearer[list(reached)] = False
        nearest[nearer], neighbor[nearer] = distance[nearer], new
        nearest[new] = np.inf
    return pairs


def line(path: tuple[str, ...], start: Array, end: Array, radius: float, color: Color, in_front: bool = False) -> Item:
    """A rod between points (k, 3) that may move."""
    way = end - start
    length = np.linalg.norm(way, axis=1, keepdims=True)
    scale = np.concatenate([np.full_like(length, radius), np.full_like(length, radius), length], axis=1)
    return Item(path, stick(), color, start, aligned(way), scale, in_front)


def joint_tips(scene: Assembly, stations: Stations, radius: float) -> Array:
    """Ends (m, 3) of joints' arrows in the world, which a picture is to hold, for a scene's radius times fineness."""
    tips = [
        stations.points(frame.body, frame.origin + reach * radius * frame.axes[:, 2])
        for joint in _joints(scene)
        for frame in (joint.frame_a, joint.frame_b)
        for reach in (_BACK, _FORTH)
    ]
    return np.concatenate([np.empty((0, 3)), *tips])


def joint_items(
    scene: Assembly, stations: Stations, place: Place, size: float, style: Style, values: Mapping[str, float]
) -> Iterator[Item]:
    """What there is to see of each joint; values are of coordinates by their names, as in `Solution.values`."""
    if style.glyphs == "none":
        return
    thick = np.full(3, size * JOINT)
    axis = arrow(size * _BACK, size * _FORTH, 0.35 * size * _ROD, 1.1 * size * _ROD)
    for joint in _joints(scene):
        kinds = {coordinate.kind for row in joint.equations for _, coordinate in row.terms}
        a, b = (place(stations.points(frame.body, frame.origin)) for frame in (joint.frame_a, joint.frame_b))
        turn_a, turn_b = (stations.rotation(f.body) @ f.axes for f in (joint.frame_a, joint.frame_b))
        hides = any(body.faces for body in joint.bodies)
        in_front = hides and style.glyphs == "in front"
        gap = float(np.linalg.norm(b - a, axis=1).max())
        sine = np.linalg.norm(np.cross(turn_a[:, :, 2], turn_b[:, :, 2]), axis=1).max()
        # Frames that slide in one plane do not hold each other by their origins: no rod is drawn between these.
        in_plane = _is_in_plane(joint) and float(np.abs(((b - a) * turn_a[:, :, 2]).sum(axis=1)).max()) <= size * MARK
        meets = bool(kinds & {COINCIDENT, SLIDE, DISTANCE, RADIUS})
        said = _said(joint, values, style)

        parts: list[tuple[str, Mesh, Array, Array, Array]] = [("ball", ball(), a, np.eye(3), thick)]
        if kinds - {COINCIDENT, DISTANCE}:
            parts.append(("axis", axis, a, turn_a, np.ones(3)))
        if gap > size * MARK and not in_plane:
            parts.append(("other ball", ball(), b, np.eye(3), thick))
        # The second axis of a hinge would lie on the first.
        if kinds - {COINCIDENT, DISTANCE, RADIUS, SLIDE} and not (meets and sine < _PARALLEL):
            parts.append(("other axis", axis, b, turn_b, np.ones(3)))
        for what, mesh, position, rotation, scale in parts:
            label = joint.name if what == "ball" else ""
            path = ("joints", joint.name, what)
            yield Item(path, mesh, COLOR, position, rotation, scale, in_front, hides=hides, said=said, label=label)
        if meets and gap > 2.0 * size * MARK and not in_plane:
            between = line(("joints", joint.name, "line"), a, b, 0.35 * size * _ROD, COLOR, in_front)
            yield replace(between, hides=hides, said=said)


def _is_in_plane(joint: Joint) -> bool:
    """Whether a joint holds nothing of where its frames are but that they are in one plane, as mates of faces do."""
    held = {
        (coordinate.kind, coordinate.component)
        for row in joint.equations
        for _, coordinate in row.terms
        if coordinate.kind in (COINCIDENT, SLIDE, DISTANCE, RADIUS)
    }
    return held == {(SLIDE, 2)}


def _said(joint: Joint, values: Mapping[str, float], style: Style) -> str:
    """A joint in words, with its coordinates."""
    told = [f"{joint.name}: {type(joint).__name__} of {' and '.join(body.name for body in joint.bodies)}"]
    for name, freedom in joint.freedoms.items():
        value = values.get(f"{joint.name}.{name}")
        if value is not None:
            told.append(f"{name} {said_value(value, freedom.coordinate.is_angle, style)}")
    return ", ".join(told)


def said_value(value: float, is_angle: bool, style: Style) -> str:
    """A coordinate of a joint in words: degrees, or a length."""
    return f"{np.rad2deg(value):.1f} deg" if is_angle else style.length(value)
