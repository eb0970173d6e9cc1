"""Proof by hulls of faces that two bodies are clear, or only touch.

Bodies between which a plane is are clear. Of others every two faces have to be parted by a plane, or one of them has to
be within the hollow of the other one, and neither body may be within the other. Where gaps are too small the second
body is made smaller or larger by next to nothing, and shifted,

    T(x) = (1 - s) x + w,

by the least that opens them all. It need not be one rigid move, nor does it matter what holds the body: if T takes no
point farther than t, the middle m of a ball in what both bodies have in common, of a larger radius than t, has T(m) in
that ball, and so in the first body, but all of T is clear of that. So a shaft in a bore of its radius, a key in its
slot, a plug in its seat and a ball in its socket touch, as do flat faces that lie on each other.
"""

from __future__ import annotations

from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from assembly.proximity.clearance.answers import Answer, Verdict
from assembly.proximity.clearance.hulls.body_hulls import BodyHulls
from assembly.proximity.clearance.hulls.outside import is_outside
from assembly.proximity.clearance.parting import least_change

__all__ = ["answer_by_hulls"]

Array = NDArray[np.float64]
Table = NDArray[np.int64]
# What a sum of products may be off, in parts of the largest coordinate.
ROUNDING = 2e-14
# Gaps are opened to the first of these parts of what a point may be moved that they can be opened to.
OPENED = (0.25, 0.05, 0.01)
# Rounds in which contacts that are left are added.
ROUNDS = 6
# The cosine of an angle between directions that are taken for one.
SAME = 1.0 - 1e-9
# Pairs of faces, of which planes along what is round are tried, at most; decimals to which these are others.
BESIDE, EQUAL = 32, 12
# Directions for discs, and for two faces, of all pairs of them, that are tried at most: of bodies of very many faces
# the proof by cells tells more quickly. Lines of a body that others are beside.
MOST, LINES = 2_000_000, 8


class _Contact(NamedTuple):
    """A half space that a part of the second body is in, or nearly.

    Attributes
    ----------
    normal : (3,)
        From the first body to the second.
    height : float
        Of what of the second body is next to the border.
    gap : float
    """

    normal: Array
    height: float
    gap: float


class _Gaps:
    """Gaps of the faces of two bodies that are near each other.

    Parameters
    ----------
    a, b : BodyHulls
        In the same axes.
    far : float
        Faces that are farther from all of the other body are passed by.
    """

    def __init__(self, a: BodyHulls, b: BodyHulls, far: float, normals: Array) -> None:
        self.a, self.b, self.normals, self.inside = a, b, normals, far
        self.reach_a, self.reach_b = a.reach(normals), b.reach(normals)
        # The normals are followed by the opposite ones.
        self.low_b = -np.roll(self.reach_b, len(normals) // 2, axis=1)
        self.of_bodies = self.low_b.min(axis=0) - self.reach_a.max(axis=0)
        self.near_a = np.flatnonzero((self.low_b.min(axis=0) - self.reach_a).max(axis=1) <= far)
        self.near_b = np.flatnonzero((self.low_b - self.reach_a.max(axis=0)).max(axis=1) <= far)

    @property
    def work(self) -> int:
        """How many directions for two faces there are to try."""
        return len(self.near_a) * len(self.near_b) * len(self.normals)

    @cached_property
    def of_faces(self) -> tuple[Array, Table, Array, Table]:
        """Gaps (m, n) of near faces by planes, and the normals; by hollows, and the numbers of these among all."""
        gaps = self.low_b[self.near_b] - self.reach_a[self.near_a, None]
        best = gaps.argmax(axis=2)
        by_plane = np.take_along_axis(gaps, best[..., None], axis=2)[..., 0]
        by_hollow, which = np.full(by_plane.shape, -np.inf), np.full(by_plane.shape, -1)
        sides = (
            (0, self.a, self.b, self.near_a, self.near_b, by_hollow, which),
            (len(self.a.hollows), self.b, self.a, self.near_b, self.near_a, by_hollow.T, which.T),
        )
        for first, one, others, near, near_others, rows, numbers in sides:
            place = {face: k for k, face in enumerate(near.tolist())}
            asked = [
                (place[face], number, hollow)
                for number, (face, hollow) in enumerate(one.hollows, first)
                if face in place
            ]
            depths = others.within([hollow for _, _, hollow in asked])[:, near_others]
            for (at, number, hollow), depth in zip(asked, depths, strict=True):
                # What touches a face from within the body is in no contact with it.
                better = (depth > rows[at]) & (hollow.is_wall | (depth > self.inside))
                rows[at, better], numbers[at, better] = depth[better], number
        return by_plane, best, by_hollow, which

    def scaled(self, part: float, shift: Array) -> _Gaps:
        """The same with the second body scaled and shifted."""
        other = object.__new__(_Gaps)
        other.a, other.b, other.normals = self.a, self.b.scaled(part, shift), self.normals
        other.near_a, other.near_b, other.reach_a = self.near_a, self.near_b, self.reach_a
        other.inside = -np.inf
        other.low_b = (1.0 - part) * self.low_b + self.normals @ shift
        other.reach_b = -np.roll(other.low_b, len(self.normals) // 2, axis=1)
        return other

    def contacts(self, below: float, open_from: float) -> tuple[list[_Contact], list[_Contact]]:
        """What is to be opened of faces with gaps below a length.

        Returns
        -------
        (list, list)
            Of faces that one direction alone may open; and of those that another one may open as well, along which the
            gap is above another length.
        """
        gaps = self.low_b[self.near_b] - self.reach_a[self.near_a, None]
        by_plane, best, by_hollow, which = self.of_faces
        single: list[_Contact] = []
        several: list[_Contact] = []
        for i, j in np.argwhere(np.maximum(by_plane, by_hollow) < below).tolist():
            if by_plane[i, j] >= by_hollow[i, j]:
                k = int(best[i, j])
                found = [_Contact(self.normals[k], float(self.low_b[self.near_b[j], k]), float(by_plane[i, j]))]
            else:
                found = self._around(int(which[i, j]), int(self.near_a[i]), int(self.near_b[j]), below)
            others = self.normals[gaps[i, j] > open_from]
            is_single = (others @ found[0].normal > SAME).all() and (
                by_hollow[i, j] <= open_from or by_hollow[i, j] > by_plane[i, j]
            )
            (single if is_single else several).extend(found)
        return single, several

    def _around(self, number: int, face_a: int, face_b: int, below: float) -> list[_Contact]:
        """Contacts of a face in a hollow with half spaces around that."""
        is_first = number < len(self.a.hollows)
        hollow = (*self.a.hollows, *self.b.hollows)[number][1]
        other, face = (self.b, face_b) if is_first else (self.a, face_a)
        inward, borders = hollow.planes(other.nearest(hollow, face))
        heights = -other.reach(-inward)[face]
        gaps = heights - borders
        # The depth in a hollow is a bound, and may be less than all of these: then the least one stands for it.
        ones = np.flatnonzero(gaps <= max(below, float(gaps.min())))
        if is_first:
            return [_Contact(inward[k], float(heights[k]), float(gaps[k])) for k in ones]
        return [_Contact(-inward[k], -float(borders[k]), float(gaps[k])) for k in ones]


def answer_by_hulls(a: BodyHulls, b: BodyHulls, least: float, touching: float) -> Answer | None:
    """That bodies are clear or only touch, or None where hulls of their faces do not tell.

    Parameters
    ----------
    a, b : BodyHulls
        In the same axes.
    least : float
        What the gap is to be more than.
    touching : float
        How far a point may be taken to have it so.
    """
    rounding = ROUNDING * max(float(np.abs(body.discs.centers).max() + body.discs.radii.max()) for body in (a, b))
    normals = _directions(a, b)
    if (len(a.discs.radii) + len(b.discs.radii)) * len(normals) > MOST:
        return None
    gaps = _Gaps(a, b, least + 2.0 * touching + rounding, normals)
    gap = float(gaps.of_bodies.max())
    if gap > least + rounding:
        return Answer(Verdict.CLEAR, gap - rounding)
    way = min(least - gap + OPENED[0] * touching, touching)
    if gap + way > least + rounding:
        return Answer(Verdict.TOUCHING, gap - rounding, way)
    if gaps.work > MOST:
        return None
    # Of faces that are not near it is more.
    bound = min(_bound(gaps), least + 2.0 * touching + rounding)
    more = _tangents(gaps, least - touching) if bound <= least - touching else np.empty((0, 3))
    if len(more):
        half = np.concatenate([normals[: len(normals) // 2], more])
        gaps = _Gaps(a, b, least + 2.0 * touching + rounding, np.concatenate([half, -half]))
        bound = min(_bound(gaps), least + 2.0 * touching + rounding)
    if bound > least + rounding:
        return Answer(Verdict.CLEAR, bound - rounding) if _are_apart(gaps, bound, rounding) else None
    # So deep as that faces are not opened at all.
    if not bound > least - 4.0 * touching or not touching > 0.0:
        return None
    return _opened(gaps, least, touching, rounding)


def _bound(gaps: _Gaps) -> float:
    """The least gap of faces that are near, infinite where none are."""
    by_plane, _, by_hollow, _ = gaps.of_faces
    return float(np.maximum(by_plane, by_hollow).min(initial=np.inf))


def _tangents(gaps: _Gaps, below: float) -> Array:
    """Normals of planes along what is round through corners of faces that are beside it, of gaps below a length.

    So the flank of a slot, whose edge lies on a shaft, is parted from that. None where there are many such faces.
    """
    by_plane, _, by_hollow, _ = gaps.of_faces
    pairs = np.argwhere(np.maximum(by_plane, by_hollow) < below)
    ways = [np.empty((0, 3))]
    for i, j in pairs.tolist() if len(pairs) <= BESIDE else ():
        a, b = gaps.a.discs_of(int(gaps.near_a[i])), gaps.b.discs_of(int(gaps.near_b[j]))
        for one, other in ((a, b), (b, a)):
            wide = int(np.argmax(one.radii))
            if one.radii[wide] > 0.0:
                off = other.centers[other.radii == 0.0] - one.centers[wide]
                ways.append(off - (off @ one.axes[wide])[:, None] * one.axes[wide])
    rows = np.concatenate(ways)
    lengths = np.linalg.norm(rows, axis=1)
    rows = rows[lengths > 0.0] / lengths[lengths > 0.0, None]
    _, first = np.unique(rows.round(EQUAL), axis=0, return_index=True)
    return np.asarray(rows[np.sort(first)])


def _are_apart(gaps: _Gaps, bound: float, rounding: float) -> bool:
    """Whether neither body is within the other; their boundaries are apart by a bound."""
    both = ((gaps.b, gaps.a, gaps.reach_a), (gaps.a, gaps.b, gaps.reach_b))
    return all(is_outside(one, other, gaps.normals, reach, bound, rounding) for one, other, reach in both)


def _opened(gaps: _Gaps, least: float, touching: float, rounding: float) -> Answer | None:
    """What is told of bodies the second of which is scaled and shifted, so that its contacts open."""
    single, several = gaps.contacts(least + touching, least - touching)
    asked = single or several[:1]
    for columns in (3, 4):
        for part in OPENED:
            wanted = least + part * touching
            answer, is_possible = _opened_by(gaps, asked, (least, wanted, touching), rounding, columns)
            if answer is not None:
                return answer
            if not is_possible:
                break
    return None


def _opened_by(
    gaps: _Gaps, asked: list[_Contact], lengths: tuple[float, float, float], rounding: float, columns: int
) -> tuple[Answer | None, bool]:
    """The same for gaps of contacts that are to be so large; and whether smaller ones might be reached where not.

    Faces that more than one direction opens may go either way: they follow where the others lead them, and are asked
    for as long as they are not open.
    """
    least, wanted, touching = lengths
    middle, radius = gaps.b.ball
    change = np.zeros(4)
    for _ in range(ROUNDS):
        normals = np.array([contact.normal for contact in asked])
        heights = np.array([contact.height for contact in asked]) - normals @ middle
        rates = np.column_stack([normals, -heights / radius])[:, :columns]
        found = least_change(rates, wanted - np.array([contact.gap for contact in asked]))
        if found is None:
            return None, False
        change[:columns] = found
        way = float(np.linalg.norm(change[:3])) + abs(float(change[3]))
        if way > touching:
            return None, True
        # x - s (x - middle) + v
        shrunk = float(change[3]) / radius
        other = gaps.scaled(shrunk, change[:3] + shrunk * middle)
        bound = min(_bound(other), least + touching + rounding)
        if bound > least + rounding:
            is_apart = _are_apart(other, bound, rounding)
            return (Answer(Verdict.TOUCHING, bound - way - rounding, way) if is_apart else None), False
        # Heights and gaps as they were before the change.
        asked = asked + [
            _before(contact, shrunk, change[:3] + shrunk * middle)
            for contacts in other.contacts(least + rounding, np.inf)
            for contact in contacts
        ]
    return None, True


def _before(contact: _Contact, part: float, shift: Array) -> _Contact:
    """A contact as it was before the second body was scaled and shifted."""
    height = (contact.height - float(contact.normal @ shift)) / (1.0 - part)
    return contact._replace(height=height, gap=contact.gap - (contact.height - height))


def _directions(a: BodyHulls, b: BodyHulls) -> Array:
    """Unit vectors along which gaps are asked, and the opposite ones.

    Normals and axes of both bodies, ways across what both go around, the way from middle to middle, and the axes of
    the coordinates: two balls about one center have none of the others.
    """
    ways = [a.directions, b.directions, (b.ball[0] - a.ball[0])[None], np.eye(3)]
    centers_a, axes_a = a.centers[:LINES, None], a.axes[:LINES, None]
    centers_b, axes_b = b.centers[None, :LINES], b.axes[None, :LINES]
    if a.centers.size and b.centers.size:
        off = centers_b - centers_a
        for axes in (axes_a, axes_b):
            ways.append((off - (off * axes).sum(axis=2, keepdims=True) * axes).reshape(-1, 3))
        ways.append(np.cross(axes_a, axes_b).reshape(-1, 3))
    rows = np.concatenate(ways)
    lengths = np.linalg.norm(rows, axis=1)
    rows = rows[lengths > 0.0] / lengths[lengths > 0.0, None]
    return np.concatenate([rows, -rows])
