"""CadQuery assemblies solved in place: every kind of constraint holds, from starts where directions have no slope."""

from __future__ import annotations

import math

import numpy as np
import pytest

import assembly as asm
from assembly.cad.markers import requirements_of

cq = pytest.importorskip("cadquery", reason="needs CadQuery, in an environment of its own: packaging/check_cad.py")

from tests.cad.residuals import moved, residual, violation  # noqa: E402  # it is of cadquery's objects

# Constraints hold to 2e-13 of the size, some 30; angles between axes are rounded by acos and atan2.
HOLDS = 2e-11


def box(*sides):
    return cq.Workplane().box(*sides)


def two(kind, value=None, a="a@faces@>Z", b="b@faces@<Z", loc=None):
    assembly = cq.Assembly(box(4, 3, 1), name="a").add(box(1, 2, 1), name="b", loc=loc)
    return assembly.constrain(a, b, kind, value)


def random_location(random):
    return cq.Location(cq.Vector(*random.uniform(-9, 9, 3)), cq.Vector(*random.normal(size=3)), random.uniform(0, 360))


def solved(assembly):
    solution = asm.cad.solve(assembly)
    assert solution.success, solution
    assert violation(assembly) < HOLDS
    return solution


@pytest.mark.parametrize("value", [None, 0, 180, 360, 540, -90, 45, 1e-3, 179.999, 270, 400])
@pytest.mark.parametrize("kind", ["Axis", "Plane"])
@pytest.mark.parametrize("faces", ["<Z", ">Z", ">X"])
def test_angles_hold_from_axes_along_each_other_and_across(kind, value, faces):
    solved(two(kind, value, b=f"b@faces@{faces}"))


@pytest.mark.parametrize("value", [None, 0, 2.5, -2.5])
@pytest.mark.parametrize("at", [(0, 0, 0), (0, 0, 1), (3, 1, 2)])
def test_points_are_at_their_distance_also_from_where_they_coincide(value, at):
    solved(two("Point", value, loc=cq.Location(cq.Vector(*at))))


@pytest.mark.parametrize("value", [None, 0, 0.75, -0.75])
@pytest.mark.parametrize("at", [(0, 0, 0), (2, 0, 0.5), (3, 1, 2)])
def test_points_are_at_their_distance_from_lines_and_planes(value, at):
    # At (2, 0, 0.5) the point is on the line.
    for kind, b in (("PointInPlane", "a@faces@>Z"), ("PointOnLine", "a@edges@>X and >Z")):
        assembly = cq.Assembly(box(4, 3, 1), name="a").add(box(1, 2, 1), name="b", loc=cq.Location(cq.Vector(*at)))
        solved(assembly.constrain("b", cq.Vertex.makeVertex(0, 0, 0), "a", b and assembly._query(b)[1], kind, value))


@pytest.mark.parametrize(
    "angles", [(10, 20, 30), (180, 0, 0), (0, 180, 0), (90, 90, 90), (0, 0, -179), (120, -60, 240)]
)
def test_a_part_is_turned_as_the_world_asks(angles):
    assembly = cq.Assembly(name="all").add(box(1, 2, 3), name="a").add(box(1, 1, 1), name="b")
    assembly.constrain("a", "FixedRotation", angles).constrain("a@faces@>Z", "FixedPoint", (1, 2, 3))
    solved(assembly.constrain("b@faces@>Z", "FixedAxis", (1, -2, 2)))


@pytest.mark.parametrize("seed", range(8))
def test_trees_with_all_values(seed):
    random = np.random.default_rng(seed)
    assembly = cq.Assembly(box(3, 2, 1), name="p0")
    for k in range(1, 9):
        other = f"p{random.integers(0, k)}"
        assembly.add(box(3, 2, 1), name=f"p{k}", loc=random_location(random))
        angle = float(random.choice([0, 30, 90, 135, 180]))
        match random.integers(0, 4):
            case 0:
                assembly.constrain(f"{other}@faces@>Z", f"p{k}@faces@<Z", "Plane", angle)
            case 1:
                assembly.constrain(f"{other}@faces@>X", f"p{k}@faces@>Y", "Axis", angle)
                assembly.constrain(f"p{k}@faces@>Z", f"{other}@faces@<Y", "PointInPlane", float(random.normal()))
            case 2:
                assembly.constrain(f"{other}@faces@>X", f"p{k}@faces@<X", "Point", float(random.uniform(0, 3)))
            case 3:
                line = f"{other}@edges@>X and >Y"
                assembly.constrain(f"p{k}@vertices@>X and >Y and >Z", line, "PointOnLine", float(random.uniform(0, 2)))
    solved(assembly)


def test_what_holds_is_left_to_the_bit():
    assembly = two("Plane")
    solved(assembly)
    before = assembly.objects["b"].loc
    solution = solved(assembly)
    assert assembly.objects["b"].loc is before and solution.iterations == 0


def test_locations_are_those_of_their_solver():
    """Where all six freedoms are taken away there is one answer."""
    ours, theirs = (two("Plane").constrain("a@faces@>X", "b@faces@>Y", "Axis", 0) for _ in range(2))
    solved(ours)
    theirs.solve()
    for mine, his in zip(moved(ours, "b"), moved(theirs, "b"), strict=True):
        # Theirs stops where costs, squares of violations, no longer change.
        assert mine == pytest.approx(his, abs=1e-6)


def test_an_assembly_that_stands_elsewhere_itself():
    """Its parts are placed in it; what the world asks for is where their solver has it."""
    place = cq.Location(cq.Vector(5, -3, 2), cq.Vector(1, 2, 3), 40)
    both = []
    for solve in (asm.cad.solve, cq.Assembly.solve):
        assembly = cq.Assembly(box(4, 3, 1), name="a", loc=place).add(box(1, 2, 1), name="b")
        assembly.constrain("b@faces@>Z", "FixedPoint", (1, 2, 9))
        assembly.constrain("b@faces@>Z", "a@faces@>Z", "Axis", 0).constrain("b@faces@>X", "a@faces@>X", "Axis", 90)
        solve(assembly)
        both.append(violation(assembly))
    assert both[0] < HOLDS and both[1] < 1e-5


def test_parts_of_one_subassembly_move_as_one():
    inner = cq.Assembly(box(2, 2, 2), name="inner").add(box(1, 1, 1), name="pin", loc=cq.Location(cq.Vector(3, 0, 0)))
    assembly = cq.Assembly(box(9, 9, 1), name="table").add(inner, name="inner", loc=cq.Location(cq.Vector(0, 0, 9)))
    assembly.constrain("inner/pin@faces@<Z", "table@faces@>Z", "Plane")
    kept = assembly.objects["inner/pin"].loc
    solution = solved(assembly)
    assert assembly.objects["inner/pin"].loc is kept
    assert [body.name for body in solution._scene.bodies] == ["inner", "table"]


def test_constraints_within_one_part_are_told():
    inner = cq.Assembly(box(2, 2, 2), name="inner").add(box(1, 1, 1), name="pin", loc=cq.Location(cq.Vector(3, 0, 0)))
    assembly = cq.Assembly(box(9, 9, 1), name="table").add(inner, name="inner")
    assembly.constrain("inner@faces@>X", "inner/pin@faces@<X", "Point", 1.5)
    assembly.constrain("inner@faces@<Z", "table@faces@>Z", "Plane")
    solved(assembly)
    assembly.constrain("inner@faces@>X", "inner/pin@faces@>X", "Point", 1.0)
    before = assembly.objects["inner"].loc
    solution = asm.cad.solve(assembly)
    assert solution.status is asm.Status.INFEASIBLE and "Point inner-inner 2" in solution.conflicting
    assert assembly.objects["inner"].loc is before


def test_fixed_parts_stay_and_what_they_contradict_is_told():
    assembly = (
        cq.Assembly().add(box(1, 1, 1), name="a").add(box(1, 1, 1), name="b", loc=cq.Location(cq.Vector(5, 0, 0)))
    )
    assembly.add(box(1, 1, 1), name="c").constrain("a", "Fixed").constrain("b", "Fixed")
    assembly.constrain("c@faces@>X", "a@faces@<X", "Plane")
    solved(assembly)
    assert moved(assembly, "b")[1] == pytest.approx([5, 0, 0], abs=0)
    # Both are fixed, and it holds.
    solved(assembly.constrain("a@faces@>X", "b@faces@<X", "Point", 4.0))
    solution = asm.cad.solve(assembly.constrain("a@faces@>X", "b@faces@<X", "Point", 3.0))
    assert solution.status is asm.Status.INFEASIBLE
    assert "Point a-b 2" in solution.conflicting


def test_a_contradiction_moves_nothing_and_has_names():
    assembly = two("Plane", loc=cq.Location(cq.Vector(0, 0, 3)))
    assembly.constrain("a", cq.Vertex.makeVertex(0, 0, 0), "b", cq.Vertex.makeVertex(0, 0, 0), "Point", 5.0)
    before = assembly.objects["b"].loc
    solution = asm.cad.solve(assembly)
    assert solution.status is asm.Status.INFEASIBLE and assembly.objects["b"].loc is before
    assert set(solution.conflicting) == {"Plane a-b", "Point a-b"}


def test_what_disagrees_by_rounding_of_drawings_is_fitted():
    assembly = two("Plane").constrain("a@faces@>Z", "b@faces@<Z", "Point", 1e-8)
    solution = asm.cad.solve(assembly)
    assert solution.success and max(residual(assembly, c) for c in assembly.constraints) < 1e-7


def test_markers_are_read_once_and_again_where_shapes_moved():
    assembly = two("Plane")
    solved(assembly)
    constraint = assembly.constraints[0]
    first = requirements_of(constraint)
    assert requirements_of(constraint) is first
    constraint.args[1].move(cq.Location(cq.Vector(0, 0, 0.25)))
    assert requirements_of(constraint) is not first
    solved(assembly)
    assert moved(assembly, "b")[1][2] == pytest.approx(0.5 + 0.5 - 0.25, abs=1e-12)


def test_constraints_that_are_added_count():
    assembly = two("Plane")
    solved(assembly)
    solved(assembly.constrain("a@faces@>X", "b@faces@>Y", "Axis", 0))
    assembly.constraints.pop()
    assert len(solved(assembly)._scene.constraints) == 1


def test_centers_that_are_off_by_rounding_are_no_size_of_the_scene():
    """OCCT finds centers of round faces to 1e-16; where nothing else is a length, that is none."""
    block, pin = box(4, 4, 2).faces(">Z").hole(1), cq.Workplane().cylinder(6, 0.5)
    assembly = cq.Assembly(block, name="block").add(pin, name="pin", loc=cq.Location((9, 9, 9), (1, 0, 0), 30))
    for kind in ("Axis", "Point"):
        assembly.constrain("block@faces@%CYLINDER", "pin@faces@%CYLINDER", kind)
    solved(assembly)


def test_every_part_held_by_the_world():
    """Their solver keeps the first part, which then does not hold; here all move."""
    assembly = cq.Assembly().add(box(1, 1, 1), name="a").add(box(1, 1, 1), name="b")
    for name, at in (("a", (0, 0, 5)), ("b", (1, 2, 3))):
        assembly.constrain(f"{name}@faces@>Z", "FixedPoint", at)
    solved(assembly.constrain("a@faces@>X", "b@faces@>X", "Axis", 90))


def test_what_cannot_be_solved_raises():
    with pytest.raises(asm.errors.InputError, match="has no constraints"):
        asm.cad.solve(cq.Assembly(box(1, 1, 1), name="a"))
    with pytest.raises(TypeError, match="expected a cadquery.Assembly"):
        asm.cad.solve(box(1, 1, 1))
    with pytest.raises(asm.errors.InputError, match="fixed and driven are for build123d"):
        asm.cad.solve(two("Plane"), fixed=["a"])
    with pytest.raises(asm.errors.InputError, match="expected a direction other than zero"):
        asm.cad.solve(cq.Assembly().add(box(1, 1, 1), name="a").constrain("a@faces@>Z", "FixedAxis", (0, 0, 0)))
    assert math.isfinite(asm.cad.solve(two("Plane"), max_iterations=0).feasibility)
