"""The room of a solve: what is carved from its two blocks of memory fits, and nothing is there twice."""

from __future__ import annotations

from itertools import pairwise

import casadi as ca
import numpy as np
import pytest

import assembly as asm
from assembly._record import Store
from assembly.constraints.program.records import header_at
from assembly.solve.loop.workspace import carve_all, carve_unknowns, workspace_needed
from benchmarks.running import example
from tests.laws.trim_scenes import trim_scene


def contacts():
    bodies = [asm.Body(f"ring {k}", asm.shapes.torus(2.0, 0.5), (2.0 * k, 0.0, 0.0), fixed=k == 0) for k in range(4)]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Contact(bodies[0], bodies[1]), asm.Clearance())
    return scene


def joints():
    bodies = [asm.Body(f"rod {k}", position=(k, 0.0, 0.0), fixed=k == 0) for k in range(5)]
    scene = asm.Assembly(bodies)
    scene.constrain(*(asm.Distance(a.point(0, 0, 0), b.point(0, 0, 0), 1.0) for a, b in pairwise(bodies)))
    scene.minimize(asm.PointDistance(bodies[-1].point(0, 0, 0), (1.0, 2.0, 3.0)))
    return scene


def expressions():
    bodies = [asm.Body(f"body {k}", position=(k, 0.0, 0.0)) for k in range(3)]
    scene = asm.Assembly(bodies)
    poses = [ca.SX.sym(name, 7) for name in "abc"]
    a, b, c = (pose[:3] for pose in poses)
    scene.constrain(asm.Expression(ca.Function("row", poses, [ca.dot(a - b, b - c)]), bodies))
    return scene


def many():
    bodies = [asm.Body(f"link {k}", position=(k, 0.0, 0.0), fixed=k == 0) for k in range(80)]
    scene = asm.Assembly(bodies)
    scene.constrain(*(asm.Spherical(a.point(0.5, 0, 0), b.point(-0.5, 0, 0)) for a, b in pairwise(bodies)))
    return scene


def trims():
    return trim_scene(1, "torus", "circle", "a", "cartesian").scene


def dexterity():
    return example("dexterity_sweep").five_bar()[0]


@pytest.mark.parametrize("lifts", [False, True])
@pytest.mark.parametrize("scene", [contacts, joints, expressions, many, trims, dexterity])
def test_nothing_stands_in_one_place(scene, lifts):
    packed = scene().packed()
    table = packed.table
    sizes = workspace_needed(table)
    doubles, integers = np.zeros(sizes[0]), np.zeros(sizes[1], dtype=np.int64)
    space = carve_all(Store(table, packed.pool), np.empty(0), packed.end_effectors, doubles, integers)
    lifted, shape = space.program.lifted, space.program.structure
    header = header_at(table, 0)
    pairs = header.contacts if lifts else 0
    system = carve_unknowns(6 * header.moving + 4 * pairs, pairs, shape.sparsity, space.room)
    assert [array.shape for array in space.system[2:]] == [array.shape for array in system[2:]] or lifts
    current, trial, held = space.iterates
    doubles[:], integers[:] = 0.0, 0
    used = [*current, *trial, *held[:3], *space.rows[2:], *space.program.tapes, space.way]
    used += [lifted.lengths, lifted.vectors, lifted.variables, lifted.guess, shape.sparsity.scratch]
    used += [system.gradient, *system.directions, system.hessian, system.factor]
    for array in used:
        array += 1.0
    sparsity = [shape.sparsity.places, shape.sparsity.folds]
    for array in (shape.bases, shape.one_sided, *sparsity, *shape.row_order, lifted.free, held.numbers):
        array += 1
    assert doubles.max() == 1.0 and integers.max() == 1
    assert doubles.sum() == sum(array.size for array in used)
    if lifts:
        # With all pairs lifted the room is full.
        assert space.room.min() == 1.0
