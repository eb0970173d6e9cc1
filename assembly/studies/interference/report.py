"""The search: pairs that boxes do not tell to be far apart, their nearest points, and one search for crossings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from assembly.assembly import Assembly
from assembly.constraints.model.contact import Contact
from assembly.errors import InputError, bounded
from assembly.kinematics.body import Body
from assembly.kinematics.pose import pose_rows
from assembly.solve.crossings import PosedBodies, find_crossings, free_pairs, joined_pairs
from assembly.solve.interruption import CTRL_C, Interruption
from assembly.solve.options import touching_part
from assembly.solve.solution import Solution
from assembly.studies.interference.bounds import Posed
from assembly.studies.interference.clash import Clash, Interference, Relation
from assembly.studies.interference.judge import Pair

__all__ = ["interference"]

Array = NDArray[np.float64]
# What parts of CAD files are in each other by rounding, in parts of the scene's size.
TOUCHING = 1e-6


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
        Bodies as a STEP file has them are a scene without constraints.
    poses : Solution or (n, 7), optional
        Where the bodies stand; by default where they were made.
    margin : float
        Not negative, in the unit of the scene. Every pair has a row that is not proven to be farther apart.
    touching : float
        What bodies may be in each other and still touch, from 0 to 0.001 parts of the scene's size.
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
    Boxes around faces tell which pairs may be near; of those the nearest points are searched for by branch and bound
    (`assembly.proximity.closest_features`). Of bodies that have points in common a plane between them proves that they
    touch, or a surface of revolution, and a ball inside of both that they cross. Where none is found, one search of a
    contact manager for all such pairs tells, as in `Solution.crossings`, and the row is not proved.
    """
    interruption = CTRL_C if time_limit is None else Interruption(time_limit)
    margin = bounded("margin", margin)
    if margin < 0.0:
        raise InputError(f"margin is {margin:g}; expected a length of at least 0")
    touching = touching_part(touching)
    if not isinstance(scene, Assembly):
        scene = Assembly(scene)
    q = _rows(scene, poses)
    shaped = [Posed(body, row) for body, row in zip(scene.bodies, q, strict=True) if body.faces]
    within = touching * max((posed.body.size for posed in shaped), default=0.0)
    pairs = [Pair(a, b, _relation(scene, a.body, b.body), within) for a, b in _near(shaped, margin)]
    near = [pair for pair in pairs if pair.apart <= margin or pair.may_nest]
    rows, searched = _rows_of(near, PosedBodies(scene.bodies, q, touching), interruption)
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


def _near(shaped: Sequence[Posed], margin: float) -> Iterator[tuple[Posed, Posed]]:
    """Pairs of bodies that are within a margin of each other by the boxes around them."""
    boxes = np.array([posed.box for posed in shaped]).reshape(-1, 2, 3)
    for k, one in enumerate(shaped):
        between = np.maximum(boxes[k + 1 :, 0] - one.box[1], one.box[0] - boxes[k + 1 :, 1])
        for other in np.flatnonzero(np.linalg.norm(np.maximum(between, 0.0), axis=1) <= margin).tolist():
            yield one, shaped[k + 1 + other]


def _relation(scene: Assembly, a: Body, b: Body) -> Relation:
    """What the constraints of a scene say of two of its bodies."""
    if joined_pairs((a, b), scene.constraints):
        return "joined"
    if not free_pairs((a, b), scene.constraints):
        return "excluded"
    contacts = (item for item in scene.constraints if isinstance(item, Contact))
    return "contact" if any({*item.bodies} == {a, b} for item in contacts) else "free"


def _rows_of(near: Sequence[Pair], posed: PosedBodies, interruption: Interruption) -> tuple[list[Clash], int]:
    """The rows of pairs, and how many were searched for their nearest points."""
    rows: list[Clash] = []
    doubtful: list[Pair] = []
    searched = 0
    for pair in near:
        if interruption.is_over():
            rows.append(pair.unsearched())
            continue
        searched += 1
        row = pair.judged()
        if row is None:
            doubtful.append(pair)
        else:
            rows.append(row)
    if not doubtful:
        return rows, searched
    found = find_crossings(posed, [(pair.a.body, pair.b.body) for pair in doubtful], interruption)
    for pair in doubtful:
        names = pair.a.body.name, pair.b.body.name
        if names in found.unseen or interruption.is_over():
            rows.append(pair.unsearched())
        else:
            rows.append(pair.searched(names in found.pairs))
    return rows, searched
