"""Lower bounds of the distance of elementary surfaces from their centers, axes and circles.

Patches of spheres, cylinders, tori and planes, and lines and circles among boundary curves, lie on surfaces whose
distance has a closed form where they share a center or an axis, or their axes are parallel. There the nearest points
are not isolated, and halving the patches would never end; the bound of the whole surfaces is the distance itself.

Where axes are not parallel, the second surface is turned about its center until they are, and where they have to
coincide it is then moved. Turning moves a point within h of the center by at most 1.5 h s, s the sine of the angle.
Two tori have another bound at any pose, the distance of their circles (`circles.py`).
"""

from __future__ import annotations

import math
from collections import namedtuple

from assembly._kernel import kernel
from assembly.distance.bodies.records import spine_at
from assembly.geometry.splines.bezier_pieces import UNIT
from assembly.geometry.vec import add, cross, dot, matvec, sub

# Kinds; of a pair of surfaces, the one of the lower kind comes first.
SPHERE, CYLINDER, TORUS, PLANE = 1.0, 2.0, 3.0, 4.0
# An elementary surface, seen from a; see records.SPINE.
Spine = namedtuple("Spine", "kind center axis radius major half")
# The center of a second surface relative to the first one's, along and across the first one's axis, and how far turning
# the second one moves its points [length].
Coaxial = namedtuple("Coaxial", "along beside off")


@kernel(inline=True)
def norm(x):
    """Length of a vector."""
    return math.sqrt(dot(x, x))


@kernel(inline=True)
def spine_of(pool, at):
    """The elementary surface of a patch in its body's coordinates."""
    s = spine_at(pool, at)
    center = (s.center[0], s.center[1], s.center[2])
    return Spine(s.kind, center, (s.axis[0], s.axis[1], s.axis[2]), s.radius, s.major, s.half)


@kernel(inline=True)
def seen_spine(pool, at, pose):
    """The elementary surface of a patch of b, seen from a."""
    s = spine_of(pool, at)
    center = add(matvec(pose.turn, s.center), pose.shift)
    return Spine(s.kind, center, matvec(pose.turn, s.axis), s.radius, s.major, s.half)


@kernel(inline=True)
def ring_gap(apart, r, s):
    """Distance of two circles of a plane, or spheres, whose centers are `apart`; not positive where they meet."""
    return max(apart - r - s, abs(r - s) - apart)


@kernel(inline=True)
def offset_from(s, point):
    """How far a point is along the axis from the center, and across it from the axis."""
    d = sub(point, s.center)
    return dot(d, s.axis), norm(cross(d, s.axis))


@kernel(inline=True)
def of_sphere(ball, s):
    """A sphere and any elementary surface."""
    if s.kind == SPHERE:
        return ring_gap(norm(sub(ball.center, s.center)), ball.radius, s.radius)
    if s.kind == PLANE:
        return abs(dot(s.axis, sub(ball.center, s.center))) - ball.radius
    along, beside = offset_from(s, ball.center)
    if s.kind == CYLINDER:
        beyond = max(0.0, abs(along) - s.half)
        nearest = math.hypot(beside - s.radius, beyond)
        farthest = math.hypot(beside + s.radius, abs(along) + s.half)
        return max(nearest - ball.radius, ball.radius - farthest)
    nearest = abs(math.hypot(beside - s.major, along) - s.radius)
    farthest = math.hypot(beside + s.major, along) + s.radius
    return max(nearest - ball.radius, ball.radius - farthest)


@kernel(inline=True)
def of_plane(s, plane):
    """A cylinder or a torus, and a plane."""
    n = plane.axis
    across = norm(cross(n, s.axis))
    reach = s.half * abs(dot(n, s.axis)) + s.radius * across
    if s.kind == TORUS:
        reach = s.major * across + s.radius
    return abs(dot(n, sub(s.center, plane.center))) - reach


@kernel(inline=True)
def of_planes(s, t):
    """Two planes; of the second one, only points within `half` of its center count."""
    return abs(dot(s.axis, sub(t.center, s.center))) - t.half * norm(cross(s.axis, t.axis))


@kernel(inline=True)
def turned_parallel(s, t):
    """The center of t relative to s, and how far points of t move as it is turned until the axes are parallel."""
    along, beside = offset_from(s, t.center)
    size = math.hypot(t.half + t.radius, t.major)
    return Coaxial(along, beside, 1.5 * size * norm(cross(s.axis, t.axis)))


@kernel(inline=True)
def of_cylinders(s, t):
    """Two cylinders, as if their axes were parallel."""
    at = turned_parallel(s, t)
    beyond = max(0.0, abs(at.along) - s.half - t.half)
    return math.hypot(max(0.0, ring_gap(at.beside, s.radius, t.radius)), beyond) - at.off


@kernel(inline=True)
def circle_of(ring):
    """The cylinder of no length that goes through the middle of the tube of a torus."""
    return Spine(CYLINDER, ring.center, ring.axis, ring.major, 0.0, 0.0)


@kernel(inline=True)
def beside_torus(s, ring):
    """A cylinder or a torus, and a torus, as if their axes were parallel: tubes are within their radii of a circle."""
    if s.kind == CYLINDER:
        return of_cylinders(s, circle_of(ring)) - ring.radius
    return of_cylinders(circle_of(s), circle_of(ring)) - s.radius - ring.radius


@kernel(inline=True)
def of_torus(s, ring):
    """A cylinder or a torus, and a torus, as if their axes were one, or parallel."""
    at = turned_parallel(s, ring)
    if s.kind == CYLINDER:
        beyond = max(0.0, abs(at.along) - s.half)
        gap = math.hypot(s.radius - ring.major, beyond) - ring.radius
    else:
        gap = ring_gap(math.hypot(s.major - ring.major, at.along), s.radius, ring.radius)
    return max(gap - at.off - at.beside, beside_torus(s, ring))


@kernel(inline=True)
def ordered_gap(s, t):
    """Lower bound of the distance of two elementary surfaces, the kind of the first not after that of the second."""
    if s.kind == SPHERE:
        return of_sphere(s, t)
    if t.kind == PLANE:
        return of_plane(s, t) if s.kind != PLANE else of_planes(s, t)
    return of_torus(s, t) if t.kind == TORUS else of_cylinders(s, t)


@kernel(inline=True)
def least_of_spine(pool, at, n):
    """A lower bound of n.P for points P of a patch on an elementary surface that is no plane, and a unit vector n."""
    s = spine_of(pool, at)
    if s.kind == PLANE:
        return -math.inf
    across = norm(cross(n, s.axis))
    reach = s.half * abs(dot(n, s.axis)) + (s.radius * across if s.kind == CYLINDER else s.radius + s.major * across)
    size = norm(s.center) + s.radius + s.major + s.half
    return dot(n, s.center) - reach - spine_at(pool, at).off - 16.0 * UNIT * size


@kernel(inner=True)
def spine_bound(a, at_a, b, at_b, pose):
    """Lower bound of the distance of two patches on elementary surfaces, whose places in their pools are given."""
    s, t = spine_of(a.pool, at_a), seen_spine(b.pool, at_b, pose)
    gap = ordered_gap(s, t) if s.kind <= t.kind else ordered_gap(t, s)
    size = norm(s.center) + norm(t.center) + s.radius + t.radius + s.major + t.major + s.half + t.half
    return gap - spine_at(a.pool, at_a).off - spine_at(b.pool, at_b).off - 64.0 * UNIT * size - pose.rounding
