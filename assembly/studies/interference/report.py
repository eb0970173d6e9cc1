"""The search: pairs that boxes cannot exclude, their nearest points, and one search for crossings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.assembly import Assembly
from assembly.constraints.model.contact import Contact
from assembly.errors import InputError, bounded
from assembly.kinematics.body import Body
from assembly.kinematics.pose import pose_rows
from assembly.proximity.clearance.answers import Verdict
from assembly.solve.crossings import free_pairs, joined_pairs, looks_at, posed_box
from assembly.solve.interruption import CTRL_C, Interruption
from assembly.solve.options import touching_part
from assembly.solve.samples import PosedBodies
from assembly.solve.solution import Solution
from assembly.studies.interference.clash import Clash, Interference, Relation
from assembly.studies.interference.depth import Two, depth_of
from assembly.studies.interference.flat_bodies import partings_of
from assembly.studies.interference.near_pair import NearPair

__all__ = ["interference"]

Array = NDArray[np.float64]
# What parts of CAD files are in each other by rounding, in parts of the scene's size.
TOUCHING = 1e-6
# What rounding may make of distances of boxes, in parts of these.
ROUNDING = 1e-14


def interference(
    scene: Assembly | Iterable[Body],
    poses: Solution | ArrayLike | None = None,
    *,
    margin: float = 0.0,
    touching: float = TOUCHING,
    time_limit: float | None = None,
) -> Interference:
    """Which bodies cross, touch, or are nearer to each other than a margin, and what of it is proven.

    Parameters
    ----------
    scene : Assembly or iterable of Body
        A list of bodies, for example of a STEP file, is a scene without constraints.
    poses : Solution or (n, 7), optional
        Poses of the bodies; by default their own.
    margin : float
        Not negative, in the unit of the scene. Every pair that is not proven to be farther apart has a row.
    touching : float
        How much bodies may overlap and still count as touching, from 0 to 0.001 parts of the scene's size.
    time_limit : float, optional
        Seconds after which pairs that were not searched are rows of the kind "undecided".

    Returns
    -------
    Interference
        Print it for a table; `to_csv` writes one, `plot` draws it.

    Raises
    ------
    InputError, TypeError
        A margin, a limit or poses that cannot be; a solution of another scene.

    Notes
    -----
    Boxes tell which pairs may be near; for these the nearest points are found by branch and bound
    (`assembly.proximity.distance`). For bodies that have points in common it is proven that they touch or cross, as in
    `Solution.crossings`. If that fails, samples decide, and the row is not proved.
    """
    interruption = CTRL_C if time_limit is None else Interruption(time_limit)
    margin = bounded("margin", margin)
    if margin < 0.0:
        raise InputError(f"margin is {margin:g}; expected a length of at least 0")
    touching = touching_part(touching)
    if not isinstance(scene, Assembly):
        scene = Assembly(scene)
    q = _rows(scene, poses)
    shaped = [k for k, body in enumerate(scene.bodies) if body.faces]
    posed = PosedBodies(scene.bodies, q, touching)
    sizes = {k: scene.bodies[k].size for k in shaped}
    within = touching * max(sizes.values(), default=0.0)
    boxed = list(_near(scene, q, shaped, margin))
    pairs = [Two(scene.bodies[i], scene.bodies[j], q[[i, j]], max(sizes[i], sizes[j]), within) for i, j, _ in boxed]
    near = [
        (NearPair(two, _relation(scene, *two.bodies), parting), apart)
        for two, parting, (_, _, apart) in zip(pairs, partings_of(pairs), boxed, strict=True)
    ]
    rows, searched = _rows_of(near, posed, margin, interruption)
    kept = [row for row in rows if row.bound <= margin or row.kind in ("crossing", "enclosed", "undecided")]
    return Interference(
        rows=tuple(sorted(kept, key=lambda row: row.order)),
        margin=margin,
        pairs=len(shaped) * (len(shaped) - 1) // 2,
        searched=searched,
        without_shape=tuple(body.name for body in scene.bodies if not body.faces),
        scene=scene,
        q=q,
    )


def _rows(scene: Assembly, poses: Solution | ArrayLike | None) -> Array:
    """Where the bodies of a scene stand, (n, 7)."""
    if poses is None:
        return np.array(scene.q)
    if not isinstance(poses, Solution):
        return pose_rows("poses", poses, len(scene.bodies))
    if tuple(poses._scene.bodies) != scene.bodies:
        raise InputError("poses is a solution of another scene, or of this one with other bodies; expected its own")
    return np.array(poses.q)


def _near(scene: Assembly, q: Array, shaped: Sequence[int], margin: float) -> Iterator[tuple[int, int, float]]:
    """Bodies that are within a margin of each other by the boxes around them, and how far apart these are."""
    boxes = np.array([posed_box(scene.bodies[k], q[k]) for k in shaped]).reshape(-1, 2, 3)
    for place, k in enumerate(shaped):
        low, high = boxes[place]
        between = np.maximum(boxes[place + 1 :, 0] - high, low - boxes[place + 1 :, 1])
        apart = np.linalg.norm(np.maximum(between, 0.0), axis=1) * (1.0 - ROUNDING)
        for other in np.flatnonzero(apart <= margin).tolist():
            yield k, shaped[place + 1 + other], float(apart[other])


def _relation(scene: Assembly, a: Body, b: Body) -> Relation:
    """What the constraints of a scene say of two of its bodies."""
    enabled = [item for item in scene.constraints if item.enabled]
    if not enabled:
        return "free"
    if joined_pairs((a, b), enabled):
        return "joined"
    if not free_pairs((a, b), enabled):
        return "excluded"
    contacts = (item for item in enabled if isinstance(item, Contact))
    return "contact" if any({*item.bodies} == {a, b} for item in contacts) else "free"


def _rows_of(
    near: Sequence[tuple[NearPair, float]], posed: PosedBodies, margin: float, interruption: Interruption
) -> tuple[list[Clash], int]:
    """The rows of pairs that are not beyond a margin, and how many were searched."""
    rows: list[Clash] = []
    asked: list[tuple[NearPair, float, bool]] = []
    searched = 0
    for pair, apart in near:
        if interruption.is_over():
            rows.append(pair.unsearched(apart))
            continue
        searched += 1
        crossing = pair.overlap()
        if crossing is not None:
            rows.append(crossing)
            continue
        beyond = pair.beyond(margin)
        if beyond.is_apart:
            if beyond.may_nest:
                asked.append((pair, apart, True))
        elif pair.is_told:
            rows.append(pair.told())
        elif pair.look is not None and pair.nearest.upper <= pair.two.touching:
            rows.append(pair.looked(pair.look))
        else:
            asked.append((pair, apart, False))
    normals = [None if is_apart else pair.normal for pair, _, is_apart in asked]
    looks = looks_at(posed, [pair.two.bodies for pair, _, _ in asked], interruption, normals)
    for (pair, apart, is_apart), look in zip(asked, looks, strict=True):
        if is_apart and look.answer.verdict is Verdict.CLEAR:
            continue
        if look.crosses is None or interruption.is_over():
            rows.append(pair.unsearched(apart))
        elif pair.is_deep(look):
            rows.append(pair.crossing(look, depth_of(pair.two, partial(_crosses_at, pair.two, interruption))))
        else:
            rows.append(pair.looked(look))
    return rows, searched


def _crosses_at(two: Two, interruption: Interruption, row: Array) -> bool:
    """Whether two bodies cross, the second one at another pose; they may where there is no time."""
    posed = PosedBodies(two.bodies, np.stack([two.q[0], row]), two.part)
    (look,) = looks_at(posed, [two.bodies], interruption)
    return look.crosses is not False
