"""Elements of solids with an extremum of their own are never passed over; most of the others are."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly._kernel import kernel
from assembly._record import Store
from assembly.constraints.program.records import MANAGER_RECORD
from assembly.proximity.brep.borders import feature_of
from assembly.proximity.bvh.tree import ELEMENT, element_at, tree_at
from assembly.proximity.extrema.face_face import CONVERGED
from assembly.proximity.extrema.feature_pair import solve_features
from assembly.proximity.manager.own_extrema import may_be_over, may_have_own
from assembly.proximity.manager.records import pair_in
from tests.laws.scenes import posed

PAIRS = {
    "pin in a bore": (
        lambda: asm.shapes.plate(6.0, 4.0, 1.2, holes=[(0.0, 0.0, 0.45)]),
        lambda: asm.shapes.solid_cylinder(0.4, 4.0),
    ),
    "pin in a bore of its radius": (
        lambda: asm.shapes.plate(6.0, 4.0, 1.2, holes=[(0.0, 0.0, 0.4)]),
        lambda: asm.shapes.solid_cylinder(0.4, 4.0),
    ),
    "ball over a box": (lambda: asm.shapes.box(2.0, 2.0, 1.0), lambda: asm.shapes.sphere(0.7)),
    "boxes": (lambda: asm.shapes.box(2.0, 1.4, 1.0), lambda: asm.shapes.box(1.0, 1.2, 0.8)),
}


@kernel
def own(pair, codes, e, d):
    """`may_have_own`, from Python."""
    return may_have_own(pair, codes, e, d)


@kernel
def over(pair, codes, e, d):
    """`may_be_over`, from Python."""
    return may_be_over(pair, codes, e, d)


@kernel
def solved(pair, codes, x):
    """Newton's method on two features from x: the status, and where it came to."""
    store = pair.store
    f, g = feature_of(store, pair.shells[0], codes[0]), feature_of(store, pair.shells[1], codes[1])
    status, there, _frame = solve_features(store, f, g, pair.pose, x, (0.0, 0.0, 0.0), 1.0, np.inf)
    return status, there


def start_of(one, other):
    return (one.middle[0], one.middle[1], other.middle[0], other.middle[1])


def is_in(there, start, half):
    """Whether parameters are in the middle nine tenths of elements: at their ends rounding decides whose they are."""
    return bool((np.abs(np.subtract(there, start)) <= 0.9 * np.array(half)).all())


@pytest.mark.parametrize("name", PAIRS)
def test_no_extremum_of_its_own_is_passed_over(name, cases):
    first, second = PAIRS[name]
    bodies = [asm.Body("first", first(), fixed=True), asm.Body("second", second(), (0.0, 0.0, 9.0))]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    packed = scene.packed()
    pair = pair_in(packed.table, packed.table[MANAGER_RECORD], 0)
    shells, trees = (int(pair.shell_f), int(pair.shell_g)), (int(pair.tree_f), int(pair.tree_g))
    store = Store(packed.table, packed.pool)
    elements = []
    for tree in trees:
        at = tree_at(packed.table, tree)
        elements.append([element_at(packed.pool, at.element_pool + ELEMENT * e) for e in range(at.elements)])
    rng = np.random.default_rng(6)
    found = passed = looked = 0
    for _ in range(cases(4, 40)):
        turn = Rotation.from_rotvec(10.0 ** rng.uniform(-6.0, -0.5) * rng.normal(size=3)).as_matrix()
        place = np.array([*rng.normal(size=2) * 0.05, rng.uniform(-0.5, 1.2)]) / packed.scale
        looked_into = posed(store, tuple(turn.ravel()), tuple(place), shells=shells, trees=trees)
        every = list(itertools.product(range(len(elements[0])), range(len(elements[1]))))
        for k in rng.choice(len(every), min(600, len(every)), replace=False):
            e, d = every[k]
            one, other = elements[0][e], elements[1][d]
            codes, start = (int(one.feature), int(other.feature)), start_of(one, other)
            half = (one.half[0], one.half[1], other.half[0], other.half[1])
            looked += 1
            told = own(looked_into, codes, e, d)
            passed += not told
            status, there = solved(looked_into, codes, start)
            if status == CONVERGED and is_in(there, start, half):
                found += 1
                assert told and over(looked_into, codes, e, d), (name, codes, start, there)
    assert found > 0 and passed > looked // 4
