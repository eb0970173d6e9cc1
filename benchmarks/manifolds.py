"""Rows of contact manifolds: plates on plates and a shaft in its bore, as kernels find them, and a call from Python."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.forms import Cylinder
from assembly.kinematics.pose import Pose
from assembly.proximity.manifolds.elementary_faces import elementary_faces
from assembly.proximity.manifolds.flat_manifolds import ON_BORDER, PLACES
from assembly.proximity.manifolds.flat_pair import flat_rows
from assembly.proximity.manifolds.records import ROW_SIZE
from assembly.proximity.manifolds.regions import PlaneRegion, plane_region
from assembly.proximity.manifolds.round_manifolds import round_record
from benchmarks.figures import figure
from benchmarks.kernels import flat_manifolds_along, round_manifolds_along
from benchmarks.timing import compare

ABOUT = """\
Each kernel runs along 200 poses, all within 0.05 mm and 1e-3 rad of one at which the faces fit: two plates of 40 by 30
mm, without holes and with three holes each that all but cover those of the other, and a shaft of 9.96 mm in a bore of
10 mm. "Rectangles" are the plates without holes. A call is of `asm.proximity.contact_manifold`."""

Array = NDArray[np.float64]
HOLES = [(-12.0, 0.0, 3.0), (0.0, 4.0, 2.5), (12.0, -2.0, 3.0)]
POSES = 200


def _facing(shape: tuple[Face, ...], up: float) -> PlaneRegion:
    """The region of the face of a plate that looks up (1) or down (-1)."""
    regions = [region for face in shape if (region := plane_region(face)) is not None]
    return next(region for region in regions if up * region.frame[-1] > 0.9)


def _wall(shape: tuple[Face, ...]) -> Array:
    """The record of the one cylinder among the faces of a body."""
    (form,) = [one.form for one in elementary_faces(shape) if isinstance(one.form, Cylinder)]
    return round_record(form)


def _poses(height: float) -> tuple[Array, Array]:
    """Turns (n, 9) and shifts (n, 3) of what stands at a height."""
    rng = np.random.default_rng(0)
    turns = Rotation.from_rotvec(rng.uniform(-1e-3, 1e-3, (POSES, 3)) / np.sqrt(3.0)).as_matrix()
    shifts = rng.uniform(-0.05, 0.05, (POSES, 3)) / np.sqrt(3.0) + (0.0, 0.0, height)
    return np.ascontiguousarray(turns.reshape(POSES, 9)), shifts


def _holding_bounds(plate: tuple[Face, ...], poses: tuple[Array, Array], rows: Array) -> int:
    """At how many poses no point of the upper plate, over the lower one, is nearer to it than the bound."""
    top, bottom = _facing(tuple(plate), 1.0), _facing(tuple(plate), -1.0)
    x, y = np.meshgrid(np.linspace(-20.0, 20.0, 81), np.linspace(-15.0, 15.0, 61))
    under = np.column_stack([x.ravel(), y.ravel(), np.full(x.size, -2.0)])
    holding = 0
    for turn, shift in zip(*poses, strict=True):
        _, bound = flat_rows(
            top.frame, top.segments, bottom.frame, bottom.segments, turn, shift, ON_BORDER * top.size, rows
        )
        points = under @ turn.reshape(3, 3).T + shift
        over = (np.abs(points[:, :2]) <= (20.0, 15.0)).all(axis=1)
        holding += bool(points[over, 2].min() - 2.0 >= bound)
    return holding


def run(quick: bool) -> dict[str, Any]:
    """Times an update of a manifold."""
    rows = np.empty((PLACES, ROW_SIZE))
    plates = {"rectangles": asm.shapes.plate(40, 30, 4, []), "plates": asm.shapes.plate(40, 30, 4, HOLES)}
    turns, shifts = _poses(4.05)
    calls: dict[str, Any] = {}
    for name, shape in plates.items():
        top, bottom = _facing(tuple(shape), 1.0), _facing(tuple(shape), -1.0)
        faces = (top.frame, top.segments), (bottom.frame, bottom.segments)
        calls[name] = lambda faces=faces, near=ON_BORDER * top.size: flat_manifolds_along(
            faces, turns, shifts, near, rows
        )
    bush, shaft = asm.shapes.plate(30, 30, 20, [(0.0, 0.0, 5.0)]), asm.shapes.solid_cylinder(4.98, 30)
    walls = [_wall(tuple(shape)) for shape in (bush, shaft)]
    inside = _poses(0.0)
    calls["bore"] = lambda: round_manifolds_along(*walls, *inside, rows)
    a, b = asm.Body("a", plates["plates"], fixed=True), asm.Body("b", plates["plates"])
    above = Pose(), Pose(np.array([0.0, 0.0, 4.05]))
    calls["call"] = lambda: asm.proximity.contact_manifold(a.face("top"), b.face("bottom"), poses=above)
    right = _holding_bounds(plates["rectangles"], (turns, shifts), rows)
    seconds = {row["who"]: row["seconds"] for row in compare(calls, repeats=5 if quick else 25)}
    return {
        "about": ABOUT,
        "figures": [
            figure("two rectangles, an update", "seconds", seconds["rectangles"] / POSES, reach=5e-6),
            figure("two plates with three holes, an update", "seconds", seconds["plates"] / POSES, reach=5e-6),
            figure("a shaft in its bore, an update", "seconds", seconds["bore"] / POSES, reach=1e-6),
            figure("two plates with three holes, a call from Python", "seconds", seconds["call"]),
            figure("bounds of rectangles that no sampled gap is below", "count", right, of=POSES, reach=POSES),
        ],
    }
