"""Which kernels scenes ask for: those of what they have in them, and no others, since every one is compiled once."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent.parent
LOOP = {"solve_program"}
TURNS = {"coordinates_at"}
CONTACTS = {"contact_rows"}
SURFACES = {"start_surfaces", "coordinate_lengths", "free_row", "free_terms", "is_extremal"}
SOLIDS = {"track_solids", "search_solids", "find_nearest"}
CLEARANCES = {"update", "has_stayed", "measure_parts", "went_beyond"}
BLOCKS, TAPES, TRIMS = {"factorize_blocks", "solve_blocks"}, {"run_scene_tape"}, {"trim_rows", "trim_terms"}
# All that solves call; shapes ask for others, before.
CALLED = BLOCKS | TAPES | TRIMS | {"find_deepest", "mark_places"}
SOLVES = LOOP | TURNS | CONTACTS | SURFACES | SOLIDS | CLEARANCES | CALLED
SCENES = {
    "joints": (
        """
crank, rod, rocker = asm.Body("crank"), asm.Body("rod"), asm.Body("rocker")
scene = asm.Assembly([ground, crank, rod, rocker])
scene.constrain(
    asm.Revolute(ground.frame(), crank.frame(), "drive", angle=0.5),
    asm.Revolute(crank.frame(at=(2, 0, 0)), rod.frame(), "elbow"),
    asm.Revolute(rod.frame(at=(5, 0, 0)), rocker.frame(at=(4, 0, 0)), "wrist"),
    asm.Revolute(ground.frame(at=(6, 0, 0)), rocker.frame(), "swing"),
)
""",
        LOOP,
    ),
    "a limit": (
        """
door = asm.Body("door")
scene = asm.Assembly([ground, door])
scene.constrain(asm.Revolute(ground, door, limits=(0.0, 1.0)))
""",
        LOOP | TURNS,
    ),
    "many bodies": (
        """
links = [ground] + [asm.Body(f"link {k}", position=(k, 0, 0)) for k in range(40)]
scene = asm.Assembly(links)
for k in range(40):
    scene.constrain(asm.Revolute(links[k].frame(at=(k > 0, 0, 0)), links[k + 1].frame(), f"hinge {k}"))
scene.minimize(asm.PointDistance(links[-1].point(1, 0, 0), target=(30, 5, 0)))
""",
        LOOP | BLOCKS,
    ),
    "an expression": (
        """
import casadi as ca
q = ca.SX.sym("q", 7)
drop = asm.Body("drop", position=(1, 2, 3))
scene = asm.Assembly([drop])
scene.constrain(asm.Expression(ca.Function("bowl", [q], [q[2] - q[0] ** 2 - q[1] ** 2]), [drop]))
""",
        LOOP | TAPES,
    ),
    "two balls": (
        """
ball = asm.Body("ball", asm.shapes.sphere(1.0), fixed=True)
other = asm.Body("other", asm.shapes.sphere(1.0), position=(3, 1, 0))
scene = asm.Assembly([ball, other])
scene.constrain(asm.Contact(ball, other))
""",
        LOOP | CONTACTS | SURFACES,
    ),
    "two boxes": (
        """
box = asm.Body("box", asm.shapes.box(1.0, 1.0, 1.0), fixed=True)
other = asm.Body("other", asm.shapes.box(1.0, 1.0, 1.0), position=(0.2, 0.1, 1.5))
scene = asm.Assembly([box, other])
scene.constrain(asm.Contact(box, other))
""",
        LOOP | CONTACTS | SOLIDS,
    ),
    "a contact and a least gap": (
        """
ball = asm.Body("ball", asm.shapes.sphere(1.0), fixed=True)
other = asm.Body("other", asm.shapes.sphere(1.0), position=(3, 1, 0))
scene = asm.Assembly([ball, other])
scene.constrain(asm.Contact(ball, other), asm.Clearance(minimum=0.1))
""",
        LOOP | CONTACTS | SURFACES | CLEARANCES | {"mark_places"},
    ),
    "a clearance": (
        """
ball = asm.Body("ball", asm.shapes.sphere(1.0), fixed=True)
other = asm.Body("other", asm.shapes.sphere(1.0), position=(3, 1, 0))
scene = asm.Assembly([ball, other])
scene.constrain(asm.Clearance())
scene.minimize(asm.PointDistance(other.point(0, 0, 0), target=(1, 0, 0)))
""",
        LOOP | CONTACTS | SURFACES | CLEARANCES,
    ),
}
SOLVE = """
import assembly as asm
from assembly._kernel.decorator import ENTRIES
ground = asm.Body("ground", fixed=True)
{}
assert scene.solve().success
print(*(function.__name__ for function, entry in ENTRIES.items() if entry.compiled.overloads))
"""


@pytest.fixture(scope="module")
def all_compiled() -> None:
    """Nothing is missing, as after `python -m tests` compiled it."""
    subprocess.run([sys.executable, "-m", "assembly.kernels", "--compile"], cwd=ROOT, check=True)


@pytest.mark.parametrize("name", SCENES)
def test_a_scene_asks_for_the_kernels_of_what_it_has_in_it(all_compiled, run_python, name):
    scene, needs = SCENES[name]
    asked = set(run_python(SOLVE.format(scene)).split())
    assert asked & SOLVES == needs
    assert "asm.shapes" in scene or asked == needs


def test_without_a_dexterity_the_loop_is_that_without_it(all_compiled, run_python):
    scene, _needs = SCENES["joints"]
    code = """
from assembly.solve.loop.augmented_lagrangian import solve_program
print(*(types[-1] for types in solve_program.overloads))
"""
    assert run_python(SOLVE.format(scene) + code).split() == ["solve_program", "none"]
