"""Scenes whose solves are recorded: joints, contacts, trims, clearances, expressions, dexterities, many bodies."""

from __future__ import annotations

import casadi
import numpy as np

import assembly as asm
from benchmarks import hands, linkages, scenes
from benchmarks.running import example
from tests.laws.tip_scenes import five_bar, geared_arm, hoop, spatial_four_bar
from tests.laws.trim_scenes import trim_scene
from tests.solve.linkages import linkage

TURNED = np.array([0.9, 0.1, 0.3, -0.2]) / np.sqrt(0.95)


def of_solution(solution):
    """The numbers of a solution, by name; its status among them."""
    numbers = {
        "status": solution.status.name,
        "iterations": solution.iterations,
        "q": solution.q,
        "objective": solution.objective,
        "feasibility": solution.feasibility,
        "stationarity": solution.stationarity,
    }
    for name, values in sorted(solution.multipliers.items()):
        numbers[f"multipliers {name}"] = values
    for name, pair in sorted(solution.contacts.items()):
        numbers[f"contact {name}"] = [*pair.parameters, pair.gap]
    return numbers


def _sweep(scene, change, values):
    """Solves one after the other, each from the solution before."""
    solution = None
    for k, value in enumerate(values):
        change(value)
        solution = scene.solve(solution)
        yield k, solution


def _drive(joint):
    def to(value):
        joint.angle = value

    return to


def joints():
    """Loops and arms: cold and warm, driven, reaching, redundant, with gears; what cannot hold."""
    scene, hinge = linkages.four_bar()
    for k, solution in _sweep(scene, _drive(hinge), np.radians(np.arange(0, 360, 60))):
        yield f"spatial four-bar {k}", of_solution(solution)
    for name in ("planar_four_bar", "bennett", "bricard"):
        for size in (1.0, 1e-3):
            scene = getattr(linkages, name)(size)
            yield f"{name} of size {size}", of_solution(scene.solve())
            mobility = scene.mobility()
            yield (
                f"mobility of {name} of size {size}",
                {"dof": mobility.dof, "rank": mobility.rank, "redundant": " ".join(mobility.redundant)},
            )
    for seed in range(30):
        yield f"random linkage {seed}", of_solution(linkage(seed).scene.solve())
    for kind in linkages.CONTRADICTIONS:
        yield f"contradiction {kind}", of_solution(linkages.contradiction(kind, 1)[0].solve())
    train, crank, _ = example("gear_train").gear_train()
    for k, solution in _sweep(train, _drive(crank), (0.0, 0.3, 0.6)):
        yield f"gear train {k}", of_solution(solution)
    yield "parallelograms", of_solution(linkages.parallelograms(4).solve())


def objectives():
    """Targets that an arm reaches and does not, saddles, limits, dexterities, expressions."""
    for kind in ("point", "rigid", "surface"):
        scene = example("four_bar").grasped(kind)[0]
        yield f"grasped {kind}", of_solution(scene.solve())
    for k, reach in enumerate((0.5, 2.0, 9.0)):
        scene, tip, hinges = linkages.arm(4, seed=3)
        for hinge in hinges:
            hinge.angle = None
        hinges[0].limits = (-1.0, 1.0)
        scene.minimize(asm.PointDistance(tip, (reach, 0.3, 0.4)))
        yield f"arm that reaches {k}", of_solution(scene.solve())
    for maker in (five_bar, geared_arm, hoop, spatial_four_bar):
        case = maker()
        solution = case.scene.solve()
        jacobian = asm.tip_jacobian(case.scene, case.tip, case.inputs, solution)
        yield f"tip of {maker.__name__}", {"q": solution.q, "jacobian": jacobian}
    linkage_, _, dexterity = example("dexterity_sweep").five_bar()
    linkage_.maximize(dexterity)
    yield "greatest manipulability", of_solution(linkage_.solve())
    x = casadi.SX.sym("q", 7)
    steep = casadi.Function("steep", [x], [(x[0] - 1) ** 4 + casadi.exp(x[1]) + (x[1] * x[2] - 0.3) ** 2])
    round_ = casadi.Function("round", [x], [casadi.sumsqr(x[:3]) - 4.0])
    point = asm.Body("point", position=(0.3, 0.2, 0.5))
    scene = asm.Assembly([point])
    scene.constrain(asm.Expression(round_, [point], name="ball", unilateral=True))
    scene.minimize(asm.Expression(steep, [point], name="steep"))
    yield "expressions", of_solution(scene.solve())


def contacts():
    """Wires, rolling and sliding bodies, solids, trimmed faces; two-sided and one-sided."""
    clips = example("paper_clips").paper_clips()
    solution = clips.solve()
    yield "clips", of_solution(solution)
    ((_, grip),) = clips.objectives
    for k in range(4):
        grip.target = np.asarray(grip.target) + (0.6, -0.4, 0.5)
        solution = clips.solve(solution)
        yield f"clips warm {k}", of_solution(solution)
    wires = scenes.linked_wires(8)
    for k, q in enumerate(wires.q):
        yield f"wires {k}", of_solution(wires.scene.solve(q))
    bowl = hands.ball_in_bowl()
    for k, x in enumerate((0.0, 4.0, 9.0, 25.0)):
        bowl.grip.target = (x, 0.3 * x, 6.0)
        yield f"ball in a bowl {k}", of_solution(bowl.scene.solve())
    cam, drive = example("cam_follower").cam_and_roller()
    for k, solution in _sweep(cam, _drive(drive), np.radians([0.0, 5.0, 40.0, 90.0])):
        yield f"cam {k}", of_solution(solution)
    slot, hand = example("pin_in_slot").pin_and_plate()

    def draw(target):
        hand.target = target

    for k, solution in _sweep(slot, draw, ((0, 0, 20), (0, 0, 2), (5, 3, 2), (30, 12, 2))):
        yield f"pin in a slot {k}", of_solution(solution)
    egg, _ = example("avoid_the_hole").egg_on_plate()
    yield "egg beside a hole", of_solution(egg.solve())
    for loop in ("circle", "polygon"):
        for form in ("signed", "parametric", "cartesian", "between"):
            case = trim_scene(2, "ellipsoid", loop, "a", form)
            yield f"trim {loop} {form}", of_solution(case.scene.solve())


def clearances():
    """Bodies that are kept apart: rings, boxes, cylinders, balls; and the same bodies that touch."""
    shapes = {
        "box": asm.shapes.box(1.0, 0.8, 0.6),
        "ball": asm.shapes.sphere(0.5),
        "cylinder": asm.shapes.solid_cylinder(0.4, 1.0),
        "ring": asm.shapes.torus(0.5, 0.15),
    }
    for k, (a, b) in enumerate((a, b) for a in shapes for b in shapes if a <= b):
        for minimum in (0.0, 0.1):
            still = asm.Body(f"{a} 1", shapes[a], fixed=True)
            drawn = asm.Body(f"{b} 2", shapes[b], (1.5 + 0.1 * k, 0.4, -0.7), TURNED)
            scene = asm.Assembly([still, drawn])
            scene.constrain(asm.Clearance(minimum=minimum))
            scene.minimize(asm.PointDistance(drawn.point(0.05, 0.02, 0.1), (0.1, 0.05, 0.0)))
            yield f"{a} and {b}, {minimum}", of_solution(scene.solve())


def many_bodies():
    """Scenes that are factorized by blocks."""
    yield "stack of boxes", of_solution(linkages.boxes(40, seed=2).solve())
    rings = hands.ring_chain(20)
    yield "chain of rings", of_solution(rings.scene.solve())
