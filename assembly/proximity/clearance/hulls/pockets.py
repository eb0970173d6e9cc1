"""Pockets and bores that cut into a cylinder: convex sets that end at its axis, into which the rest of it does not go.

Also hulls of bores that end in the wall of a cylinder: no farther out than that.

Straight up along a direction d across the axis, or one that leans, the side of a cylinder whose outward normals lead
along d is met once by every line. So what of it is above a convex set, there, is one connected part of the cylinder. If
no curve of the face's boundary is within the set, and one point of that part is none of the face, no point of it is.
The set is what is within the walls that the curves of one hole lie on: planes, and bores along d.
"""

from __future__ import annotations

from itertools import combinations
from math import pi
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.distance.bodies.boundary_patches import boundary_patches
from assembly.distance.bodies.patch_blocks import patches_of
from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.forms import Cylinder, Form, Plane
from assembly.geometry.recognition.nets import bezier_dot
from assembly.geometry.splines import bezier
from assembly.proximity.clearance.hulls.discs import Discs
from assembly.proximity.clearance.hulls.prism import NO_ARCS, Arcs, Prism

__all__ = ["Bent", "bent_wall"]

Array = NDArray[np.float64]
# How far the control points of an edge may be from a wall, in parts of the size of the face.
NEARLY = 1e-5
# How far from a right angle, or parallel, directions of walls may be.
ALONG = 1e-9
# [radii] How far above the axis a pocket ends.
LOW = 1e-6
# [radii] How far from its axis a bore that leads through a cylinder is, at most.
BESIDE = 0.999
# In how many parts a curve of the boundary is, at least.
PARTS = 16
# Holes of a face that are asked, at most.
MOST = 12


class _Curve(NamedTuple):
    """A curve of a face's boundary in space, in parts: homogeneous control points (n + 1, m, 4), an array a degree.

    It may be off by `error`.
    """

    nets: list[Array]
    error: float

    @property
    def points(self) -> Array:
        """Control points (k, 3) of all parts."""
        return np.concatenate([(net[..., :3] / net[..., 3:]).reshape(-1, 3) for net in self.nets])

    @property
    def ends(self) -> Array:
        """The points (k, 3) in which parts begin and end."""
        return np.concatenate([(net[k, :, :3] / net[k, :, 3:]) for net in self.nets for k in (0, -1)])

    def between(self, point: Array, axis: Array) -> tuple[float, float]:
        """How far it is from an axis, at least and at most: squares are between their Bernstein coefficients."""
        across = np.linalg.svd(axis[None])[2][1:]
        found = []
        for net in self.nets:
            beside = np.moveaxis((net[..., :3] - net[..., 3:] * point) @ across.T, 0, 2)[..., None]
            weights = net[..., 3].T[:, None, :, None]
            found.append((bezier_dot(beside, beside) / bezier_dot(weights, weights)).ravel())
        squares = np.concatenate(found)
        least, most = (float(np.sqrt(max(value, 0.0))) for value in (squares.min(), squares.max()))
        return least - self.error, most + self.error


class _Wall(NamedTuple):
    """A wall of a pocket, with the curve of the hole's boundary that lies on it."""

    form: Plane | Cylinder
    curve: _Curve


class Bent(NamedTuple):
    """What is known of a face on a cylinder with a boundary that is not all along its parameters.

    Attributes
    ----------
    hulls : list of (Discs, float)
        At most one, with a pad.
    pockets : list of Prism
        Convex sets in its holes, above its axis.
    """

    hulls: list[tuple[Discs, float]]
    pockets: list[Prism]


def bent_wall(face: Face, form: Form, walls: list[Form]) -> Bent | None:
    """What is known of a face, if it is one of these; `walls` are what the other faces of the body are."""
    if not isinstance(form, Cylinder) or face.outer is None or len(face.chains) > MOST:
        return None
    is_along = [any(np.ptp(curve.control_points[:, k]) == 0.0 for k in (0, 1)) for curve in face.boundary]
    if all(is_along) and all(len(chain) == 1 for chain in face.chains[1:]):
        # Its ends say as much.
        return None
    curves = _curves_of(face)
    if not curves:
        return None
    hulls, found = _hulls(form, walls, curves), _pockets(face, form, walls, curves)
    return Bent(hulls, found) if hulls or found else None


def _hulls(form: Cylinder, walls: list[Form], curves: list[_Curve]) -> list[tuple[Discs, float]]:
    """The narrowest cylinder of another face that a boundary is in, and so all lines from there to there."""
    best: tuple[Discs, float] | None = None
    for wall in walls:
        if not isinstance(wall, Cylinder) or (best is not None and wall.radius >= best[0].radii[0]):
            continue
        heights = np.concatenate([(curve.points - wall.point) @ wall.axis for curve in curves])
        beyond = max(wall.heights[0] - heights.min(), heights.max() - wall.heights[1])
        beyond = max(beyond, max(curve.between(wall.point, wall.axis)[1] for curve in curves) - wall.radius, 0.0)
        if beyond > NEARLY * wall.radius:
            continue
        centers = wall.point + np.array(wall.heights)[:, None] * wall.axis
        pad = beyond + max(curve.error for curve in curves) + 2.0 * form.deviation
        best = Discs(centers, np.tile(wall.axis, (2, 1)), np.full(2, wall.radius)), pad
    return [] if best is None else [best]


def _pockets(face: Face, form: Cylinder, walls: list[Form], curves: list[_Curve]) -> list[Prism]:
    """Convex sets of the pockets in a cylinder, above its axis."""
    off = NEARLY * float(face.surface.size)
    found = []
    for chain in face.chains[1:]:
        on = [_wall_of(curves[k], walls, off) for k in chain]
        pocket = _pocket(form, [wall for wall in on if wall is not None]) if None not in on else None
        if pocket is not None and _is_hole(face, chain, pocket):
            others = [own for k, own in enumerate(curves) if k not in chain]
            if all(_is_beyond(pocket, own) for own in others):
                found.append(pocket)
    return [*found, *_through(form, found)]


def _through(form: Cylinder, found: list[Prism]) -> list[Prism]:
    """The bores that lead through all of a cylinder: what two pockets on both sides of its axis are in."""
    ends = [pocket for pocket in found if len(pocket.inward) == 1 and (pocket.arcs.halves == pi).all()]
    bores = []
    for one, other in combinations(ends, 2):
        arcs = Arcs(*(np.concatenate(column) for column in zip(one.arcs, other.arcs, strict=True)))
        aside = np.abs((arcs.centers - form.point) @ np.cross(one.inward[0], form.axis)) + arcs.radii
        # Where outward normals lead along neither direction the cylinder is beside the bore.
        if one.inward[0] @ other.inward[0] < ALONG - 1.0 and aside.min() < BESIDE * form.radius:
            bores.append(Prism(one.axis, np.empty((0, 3)), np.empty(0), arcs))
    return bores


def _curves_of(face: Face) -> list[_Curve]:
    """The curves of a face's boundary in space, in some parts at least; none if one of them is a point."""
    found: list[dict[int, list[Array]]] = [{} for _ in face.boundary]
    errors = np.zeros(len(face.boundary))
    for block in boundary_patches(face, patches_of(face, 0, np.zeros(3))):
        net = block.nets[0, :, 0]
        found[block.curve].setdefault(len(net), []).append(net)
        errors[block.curve] = max(errors[block.curve], block.error)
    if not all(found):
        return []
    curves = []
    for of_degrees, error in zip(found, errors.tolist(), strict=True):
        nets = [np.stack(parts, axis=1) for parts in of_degrees.values()]
        while sum(net.shape[1] for net in nets) < PARTS:
            nets = [np.concatenate(bezier.divided(net, 0.5), axis=1) for net in nets]
        curves.append(_Curve(nets, error))
    return curves


def _wall_of(curve: _Curve, walls: list[Form], off: float) -> _Wall | None:
    """The wall that a curve lies on, where its parts end: the nearest one."""
    points, best, found = curve.ends, off, None
    for form in walls:
        if isinstance(form, Plane):
            away = float(np.abs((points - form.point) @ form.normal).max())
        elif isinstance(form, Cylinder):
            beside = np.linalg.norm(np.cross(points - form.point, form.axis), axis=1)
            away = float(np.abs(beside - form.radius).max())
        else:
            continue
        if away <= best:
            best, found = away, _Wall(form, curve)
    return found


def _pocket(form: Cylinder, walls: list[_Wall]) -> Prism | None:
    """What is within walls, and above the axis of a cylinder, along the direction that all walls lead along."""
    middle = np.concatenate([wall.curve.ends for wall in walls]).mean(axis=0)
    normals = [wall.form.normal for wall in walls if isinstance(wall.form, Plane)]
    axes = [wall.form.axis for wall in walls if isinstance(wall.form, Cylinder)]
    ways = np.array([*axes, *(np.cross(a, b) for a, b in combinations(normals, 2))]).reshape(-1, 3)
    lengths = np.linalg.norm(ways, axis=1)
    if not len(ways) or not lengths.max() > ALONG:
        return None
    along = ways[int(lengths.argmax())] / lengths.max()
    up = along - (along @ form.axis) * form.axis
    height = (middle - form.point) @ up
    if not np.linalg.norm(up) > ALONG or height == 0.0:
        return None
    along = along if height > 0.0 else -along
    up *= np.sign(height) / np.linalg.norm(up)
    leaning = [abs(float(normal @ along)) for normal in normals]
    leaning += [float(np.linalg.norm(np.cross(axis, along))) for axis in axes]
    if max(leaning) > ALONG:
        return None
    # Not quite at the axis, where outward normals no longer lead along the direction.
    inward, borders = [up], [float(up @ form.point) + LOW * form.radius]
    # The edges that lie on walls are beyond these.
    is_bore = not normals and all(wall.form is walls[0].form for wall in walls)
    rounds = []
    for wall in walls:
        if isinstance(wall.form, Plane):
            inward.append(wall.form.normal * np.sign((middle - wall.form.point) @ wall.form.normal))
            borders.append(float((wall.curve.points @ inward[-1]).max()) + wall.curve.error)
        else:
            rounds.append(_arc(wall.form, wall.curve, along, is_bore))
    arcs = Arcs(*(np.array(column) for column in zip(*rounds, strict=True))) if rounds else NO_ARCS
    return Prism(along, np.array(inward), np.array(borders), arcs, is_one_sided=True)


def _arc(bore: Cylinder, curve: _Curve, along: Array, is_whole: bool) -> tuple[Array, Array, float, float]:
    """An arc that a curve on a bore is not within: center, direction of its middle, radius, and half of its angle."""
    radius = curve.between(bore.point, along)[0]
    off = curve.points - bore.point
    off -= (off @ along)[:, None] * along
    middle = off.mean(axis=0)
    size = float(np.linalg.norm(middle))
    if is_whole or not size > 0.0:
        return bore.point, np.linalg.svd(along[None])[2][1], radius, pi
    middle /= size
    angles = np.arctan2(off @ np.cross(along, middle), off @ middle)
    return bore.point, middle, radius, float(np.abs(angles).max())


def _is_hole(face: Face, chain: range, pocket: Prism) -> bool:
    """Whether a point of the cylinder that is in a pocket is none of the face."""
    middle = np.mean([face.boundary[k].control_points.mean(axis=0) for k in chain], axis=0)
    if not face.locate(*middle) < 0:
        return False
    uv = []
    for k, (low, high) in enumerate(face.surface.domain):
        turned = low + (middle[k] - low) % (high - low) if face.surface.closed[k] else min(max(middle[k], low), high)
        uv.append(turned)
    point = np.asarray(face.surface.evaluate(*uv))
    return bool(pocket.depth_of(point[None])[0] > 0.0)


def _is_beyond(pocket: Prism, curve: _Curve) -> bool:
    """Whether of every part of a curve one half space of a pocket has nothing within."""
    inward, borders = pocket.planes(curve.ends.mean(axis=0))
    for net in curve.nets:
        away = np.all((net[..., :3] / net[..., 3:]) @ inward.T <= borders - curve.error, axis=0)
        if not away.any(axis=1).all():
            return False
    return True
