"""What there is to see in a scene: bodies, joints, contacts, targets, ellipsoids, and the eye that looks at them.

Everything is placed about the middle of the scene and scaled to its size, so that a scene far from the origin, or
in micrometres, looks the same in a browser that computes with single precision.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import cycle

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.assembly import Assembly
from assembly.constraints.model.objectives import PointDistance
from assembly.errors import InputError, vector
from assembly.kinematics.body import Body
from assembly.kinematics.ellipsoid import Ellipsoid
from assembly.solve.solution import Solution
from assembly.studies.interference.clash import Interference
from assembly.view.clashes import clash_items, shown_as
from assembly.view.item import Color, Item, Picture, Place, Stations, framed
from assembly.view.marks import arrow, ball, cross
from assembly.view.mesh import Mesh, body_mesh
from assembly.view.motion import aligned, sample_times
from assembly.view.outline import body_lines
from assembly.view.series import (
    Ellipsoids,
    Pairs,
    Trajectory,
    contact_series,
    ellipsoid_series,
    poses_at,
    solution_rows,
    stills,
    trajectory_rows,
)
from assembly.view.skeleton import JOINT, MARK, fineness, held_points, joint_items, joint_tips, line, link_mesh
from assembly.view.style import Style, checked_style

__all__ = ["DIRECTION", "PENETRATING", "TOUCHING", "draw", "film"]

Array = NDArray[np.float64]

# From the scene to the camera, which is in front, a little to the right and above.
DIRECTION = (0.65, -1.0, 0.3)

# A body whose name is a color has that color; the others take turns with the rest of the first nine.
_NAMED: dict[str, Color] = {
    "blue": (0.16, 0.42, 0.85),
    "orange": (0.95, 0.52, 0.12),
    "green": (0.15, 0.66, 0.36),
    "purple": (0.53, 0.33, 0.78),
    "red": (0.86, 0.18, 0.20),
    "cyan": (0.10, 0.66, 0.75),
    "yellow": (0.93, 0.76, 0.15),
    "pink": (0.90, 0.42, 0.65),
    "brown": (0.58, 0.38, 0.25),
    "black": (0.13, 0.14, 0.16),
    "gray": (0.55, 0.57, 0.60),
    "white": (0.93, 0.93, 0.92),
}
_PALETTE = tuple(_NAMED.values())[:9]
_GROUND: Color = (0.60, 0.62, 0.66)
_GRAY = np.array(_GROUND)
TOUCHING: Color = (1.00, 0.72, 0.10)
PENETRATING: Color = (0.95, 0.05, 0.65)
_TARGET_COLOR: Color = (0.16, 0.17, 0.20)
_ELLIPSOID: Color = (0.35, 0.20, 0.80)
# Names of contacts that a clearance finds: the bodies' names, and a number.
_FOUND = re.compile(r"^clearance: (.*?)( \d+)?$")
# Targets farther away than this, in radii of the scene, do not make the picture larger: parts would become too small.
_FARTHEST = 1.5
# Half the width of the cross at a target, in parts of the scene's radius.
_ARM = 3.0 * MARK
# The gap, in parts of the scene's radius, below which surfaces interpenetrate.
_PENETRATION = -1e-9
# Of ellipsoids: half the thickness of a flat one, in parts of the scene's radius, and the opacity.
_THIN = 0.004
_VEIL = 0.35
# Number of vertices of a large ball.
_SMOOTH = 2000
# The camera is farther from a motion by this factor, which leaves room for the controls below it.
_ROOM = 1.15
# Number of directions: a motion is framed by the vertices that are outermost in one of them.
_OUTLOOKS = 200


def body_colors(bodies: Sequence[Body]) -> Iterator[Color]:
    """Colors of their own, or by name, or in turn with those that no name has taken."""
    names = [body.name.strip().lower() for body in bodies]
    free = [color for color in _PALETTE if color not in [_NAMED.get(name) for name in names]]
    turns = cycle(free or _PALETTE)
    for body, name in zip(bodies, names, strict=True):
        if body.color is not None:
            yield body.color
            continue
        if body.fixed and not body.faces and body.picture is None and name not in _NAMED:
            # The ground of a mechanism.
            yield _GROUND
            continue
        color = np.array(_NAMED[name] if name in _NAMED else next(turns))
        red, green, blue = (0.75 * color + 0.25 * _GRAY if body.fixed else color).tolist()
        yield red, green, blue


def _bodies(
    scene: Assembly,
    meshes: dict[Body, Mesh | None],
    held: dict[Body, Array],
    stations: Stations,
    place: Place,
    size: float,
    interference: Interference | None,
    style: Style,
) -> Iterator[Item]:
    faint = {} if interference is None else shown_as(interference)
    for (body, mesh), own in zip(meshes.items(), body_colors(scene.bodies), strict=True):
        path, rotation = ("bodies", body.name), stations.rotation(body)
        color, opacity = faint.get(body.name, (own, 1.0))
        opacity *= style.opacity_of(body)
        said = f"{body.name}, fixed" if body.fixed else body.name
        if mesh is None and not len(held[body]):
            at = place(stations.points(body, np.zeros(3)))
            dot = np.full(3, MARK)
            yield Item(path, ball(), color, at, rotation, dot, opacity=opacity, said=said, label=body.name)
            continue
        scale = np.full(3, place.scale)
        if mesh is None:
            mesh, scale = link_mesh(place.scale * held[body], size), np.ones(3)
        # About its own middle, for a shape that was drawn far from the origin of its body.
        middle = 0.5 * (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0))
        position = place(stations.points(body, scale * middle / place.scale))
        lines = body_lines(body, mesh, style.angle) if style.edges else None
        if lines is not None:
            lines = lines.about(middle)
        shown = mesh.about(middle)
        if faint:
            # Colors that faces have of their own would hide which bodies cross.
            shown = replace(shown, colors=None)
        item = Item(path, shown, color, position, rotation, scale, opacity=opacity, lines=lines)
        yield replace(item, said=said, label=body.name)


def _contact(pair: Pairs, place: Place, style: Style, name: str) -> Iterator[Item]:
    """A ball at each point, and the normal of the first surface as an arrow; nothing while there is no pair."""
    if style.glyphs == "none":
        return
    color = PENETRATING if pair.gaps.min() * place.scale < _PENETRATION else TOUCHING
    shown, in_front = pair.shown[:, None], style.glyphs == "in front"
    said = f"contact {pair.name}"
    if len(pair.gaps) == 1:
        said += f", gap {style.length(float(pair.gaps[0]), 2)}"
    f, g = place(pair.points[:, 0]), place(pair.points[:, 1])
    for what, point, label in (("point", f, name), ("other point", g, "")):
        path, scale = ("contacts", pair.name, what), shown * np.full(3, MARK)
        yield Item(path, ball(), color, point, scale=scale, in_front=in_front, hides=True, said=said, label=label)
    mesh, path = arrow(0.0, 7.0 * MARK, 0.22 * MARK, 0.7 * MARK), ("contacts", pair.name, "normal")
    turned = aligned(pair.normals)
    yield Item(path, mesh, color, f, turned, shown * np.ones(3), in_front, hides=True, said=said)


def _target_items(name: str, body: str, target: Array, point: Array, radius: float) -> Iterator[Item]:
    """A cross at the target, a ball at the point (k, 3) that is drawn to it, and a line between them."""
    said = f"{name}, of a point of {body}"
    yield Item(("targets", name, "target"), cross(_ARM, 0.3 * MARK), _TARGET_COLOR, target, said=said, label=name)
    yield Item(("targets", name, "point"), ball(), _TARGET_COLOR, point, scale=np.full(3, radius), said=said)
    if np.linalg.norm(target - point, axis=1).max() > 2.0 * MARK:
        ends = np.broadcast_to(target, point.shape)
        yield replace(line(("targets", name, "line"), point, ends, 0.25 * MARK, _TARGET_COLOR), said=said)


def _ellipsoid(name: str, shape: Ellipsoids, place: Place) -> Iterator[Item]:
    """The solid, which can be seen through, and its axes as rods."""
    color = _ELLIPSOID if shape.color is None else shape.color
    center, lengths = place(shape.centers), place.scale * shape.lengths
    path = ("ellipsoids", name, "solid")
    yield Item(path, ball(_SMOOTH), color, center, shape.axes, np.maximum(lengths, _THIN), opacity=_VEIL, said=name)
    for k in range(3):
        if lengths[:, k].max() > 0.0:
            half = lengths[:, k, None] * shape.axes[:, :, k]
            yield line(("ellipsoids", name, f"axis {k + 1}"), center - half, center + half, 0.25 * MARK, color)


def _outermost(vertices: Array) -> Array:
    """The vertices that are outermost in some of many directions, spread evenly over the sphere."""
    k = np.arange(_OUTLOOKS) + 0.5
    height, turn = 1.0 - 2.0 * k / _OUTLOOKS, np.pi * (1.0 + np.sqrt(5.0)) * k
    level = np.sqrt(1.0 - height**2)
    directions = np.column_stack([level * np.cos(turn), level * np.sin(turn), height])
    result: Array = vertices[np.unique((vertices @ directions.T).argmax(axis=0))]
    return result


def _outline(
    meshes: dict[Body, Mesh | None], held: dict[Body, Array], stations: Stations, ellipsoids: Sequence[Ellipsoids]
) -> Iterator[Array]:
    """Points (k, m, 3) of the world that the eye is to see of bodies and ellipsoids."""
    for body, mesh in meshes.items():
        if mesh is None:
            yield stations.points(body, held[body] if len(held[body]) else np.zeros((1, 3)))
        else:
            yield stations.points(body, mesh.vertices if stations.count == 1 else _outermost(mesh.vertices))
    for shape in ellipsoids:
        solid = ball().vertices * shape.lengths[:, None]
        yield solid @ np.swapaxes(shape.axes, 1, 2) + shape.centers[:, None]


def _nearer(points: Array, parts: Array) -> Array:
    """Points (m, 3), those far from the parts at (n, 3) drawn toward their middle: parts stay as large as they are."""
    low, high = parts.min(axis=0), parts.max(axis=0)
    middle, radius = 0.5 * (low + high), 0.5 * float(np.linalg.norm(high - low))
    away = points - middle
    distance = np.linalg.norm(away, axis=1, keepdims=True)
    if radius == 0.0:
        return points
    result: Array = middle + away * np.minimum(1.0, _FARTHEST * radius / np.maximum(distance, radius))
    return result


def _picture(
    scene: Assembly,
    stations: Stations,
    times: Array,
    pairs: Sequence[Pairs],
    ellipsoids: Sequence[Ellipsoids],
    toward: Array,
    style: Style,
    *,
    interference: Interference | None = None,
    values: Mapping[str, float] | None = None,
) -> Picture:
    meshes = {body: body_mesh(body, angle=style.angle) for body in scene.bodies}
    held = held_points(scene)
    aims = [objective for _, objective in scene.objectives if isinstance(objective, PointDistance)]
    drawn = [stations.points(aim.point.body, aim.point.coordinates) for aim in aims]
    parts = np.concatenate([points.reshape(-1, 3) for points in _outline(meshes, held, stations, ellipsoids)])
    targets = _nearer(np.array([aim.target for aim in aims]).reshape(-1, 3), parts)
    outline = np.concatenate([parts, *(points.reshape(-1, 3) for points in drawn), targets])
    radius = 0.5 * float(np.linalg.norm(np.ptp(outline, axis=0)))
    arms = _ARM * radius * np.concatenate([np.eye(3), -np.eye(3)])
    tips = [target + arms for target in targets]
    size = fineness(scene, held, radius)
    place, distance = framed(np.concatenate([outline, *tips, joint_tips(scene, stations, size * radius)]), toward)

    items = list(_bodies(scene, meshes, held, stations, place, size, interference, style))
    items.extend(joint_items(scene, stations, place, size, style, values or {}))
    named = set()
    for pair in pairs:
        # Of several contacts that a clearance finds between two bodies, only the first has a label.
        label = _FOUND.sub(r"\1", pair.name)
        items.extend(_contact(pair, place, style, "" if label in named else label))
        named.add(label)
    for k, (aim, point) in enumerate(zip(aims, drawn, strict=True)):
        thick = 0.8 * MARK if aim.point.body.faces else size * JOINT
        items.extend(_target_items(f"target {k + 1}", aim.point.body.name, place(aim.target), place(point), thick))
    for k, shape in enumerate(ellipsoids):
        items.extend(_ellipsoid(f"ellipsoid {k + 1}", shape, place))
    if interference is not None:
        items.extend(clash_items(interference, place))
    if stations.count > 1:
        distance *= _ROOM
    return Picture(tuple(items), distance * toward / np.linalg.norm(toward), times, place.scale, style)


def _checked(scene: Assembly, direction: ArrayLike) -> Array:
    """The direction to the eye, of a scene that can be drawn."""
    if not isinstance(scene, Assembly):
        raise TypeError(f"scene is {scene!r}; expected an Assembly")
    if not scene.bodies:
        raise InputError("scene has no bodies; expected one at least")
    toward = vector("direction", direction)
    if not np.linalg.norm(toward) > 0.0:
        raise InputError(f"direction is {toward.tolist()}; expected a direction other than zero")
    return toward


def draw(
    scene: Assembly,
    solution: Solution | None = None,
    direction: ArrayLike = DIRECTION,
    ellipsoids: Ellipsoid | Iterable[Ellipsoid] = (),
    interference: Interference | None = None,
    style: Style | None = None,
) -> Picture:
    """Place everything there is to see.

    Parameters
    ----------
    scene : Assembly
    solution : Solution, optional
        One of this scene: bodies stand where it says, and its contacts are shown. Without one, bodies stand where
        they were made.
    direction : (3,)
        From the scene to the eye.
    ellipsoids : Ellipsoid or several
    interference : Interference, optional
        One of this scene, instead of a solution: bodies stand where it was made, and its places are shown.
    style : Style, optional

    Raises
    ------
    InputError, TypeError
        A scene without bodies, a solution or a report of other bodies, or something that is neither.
    """
    toward = _checked(scene, direction)
    look = checked_style(style, (body.name for body in scene.bodies))
    if interference is not None:
        _check_report(scene, solution, interference)
    if solution is not None and not isinstance(solution, Solution):
        raise TypeError(f"solution is {solution!r}; expected a Solution, or None")
    q = scene.q if solution is None else solution_rows(scene, solution)
    if interference is not None:
        q = interference.q
    times = np.zeros(1)
    pairs = [] if solution is None else contact_series([solution], times)
    stations, values = Stations(scene.bodies, q[None]), None if solution is None else solution.values
    shapes = stills(ellipsoids)
    return _picture(scene, stations, times, pairs, shapes, toward, look, interference=interference, values=values)


def _check_report(scene: Assembly, solution: Solution | None, report: Interference) -> None:
    """Raise where a report is none of the scene, or is not alone."""
    if not isinstance(report, Interference):
        raise TypeError(f"interference is {report!r}; expected an Interference, or None")
    if report.scene.bodies != scene.bodies:
        raise InputError("interference is a report of another scene; expected one of the bodies of this scene")
    if solution is not None:
        raise InputError("solution and interference are both given; expected one of them: a report has its own poses")


def film(
    scene: Assembly,
    trajectory: Trajectory,
    direction: ArrayLike = DIRECTION,
    ellipsoids: Ellipsoid | Iterable[Ellipsoid | Iterable[Ellipsoid]] = (),
    style: Style | None = None,
) -> Picture:
    """Place everything there is to see at the frames of a trajectory, and between them.

    Parameters
    ----------
    scene : Assembly
    trajectory : (frames, n, 7) or sequence of Solution
        Two frames at least. Contacts are those of the solutions, if they are solutions.
    direction : (3,)
        From the scene to the eye.
    ellipsoids : Ellipsoid, or for each frame one or several
        A single one stays as it is.
    style : Style, optional

    Raises
    ------
    InputError, TypeError
        A scene without bodies, a trajectory of another shape or of other bodies.
    """
    toward = _checked(scene, direction)
    look = checked_style(style, (body.name for body in scene.bodies))
    q, solutions = trajectory_rows(scene, trajectory)
    times = sample_times(q)
    shapes = ellipsoid_series(ellipsoids, len(q), times)
    stations = Stations(scene.bodies, poses_at(q, times))
    return _picture(scene, stations, times, contact_series(solutions, times), shapes, toward, look)
