"""Queries that are recorded: certified distances, collisions, extremal pairs, closest features."""

from __future__ import annotations

import casadi
import numpy as np

import assembly as asm
from assembly.proximity import (
    closest_features,
    collisions,
    contact_jacobian,
    enclosure,
    extremal_pair,
    gap_gradient,
    gap_hessian,
    minimum_distance,
    minimum_distances,
)
from benchmarks import scenes
from tests.laws.curve_queries import CURVES, random_curve


def _of_separation(found):
    return {
        "status": found.status.name,
        "lower": found.lower,
        "upper": found.upper,
        "parameters": np.concatenate([np.ravel(part) for part in found.parameters]),
        "evaluations": found.evaluations,
    }


def distances():
    """Certified distances of curves, surfaces, formulas, hulls and points."""
    rng = np.random.default_rng(6)
    for kind in CURVES:
        for dimension in (2, 3):
            a, b = (random_curve(rng, k, dimension) for k in (kind, "rational cubic of five spans"))
            b = asm.NurbsCurve(b.control_points + 0.8, b.knots, b.degree, b.weights)
            yield f"{kind} in {dimension} dimensions", _of_separation(minimum_distance(a, b))
            yield f"point and {kind} in {dimension}", _of_separation(minimum_distance(np.full(dimension, 1.3), a))
            yield (
                f"hull and {kind} in {dimension}",
                _of_separation(minimum_distance(rng.random((6, dimension)) + 1.2, a)),
            )
        lower, upper, parameters = minimum_distances(2.0 * rng.random((5, 3)), random_curve(rng, kind, 3))
        yield f"points and {kind}", {"lower": lower, "upper": upper, "parameters": parameters}
    domes = [scenes.bicubic(seed) for seed in (1, 2, 3)]
    for k, surface in enumerate(domes):
        moved = asm.NurbsSurface(surface.control_points + (0.3, 0.2, 3.0), surface.knots, surface.degree)
        yield f"domes {k}", _of_separation(minimum_distance(domes[k - 1], moved, 1e-6))
        yield f"dome and curve {k}", _of_separation(minimum_distance(moved, random_curve(rng, "cubic", 3), 1e-6))
    t = casadi.SX.sym("t")
    wave = asm.FormulaCurve(casadi.vertcat(t, casadi.sin(3 * t), t**2), t, (0.0, 2.0))
    yield "formula and point", _of_separation(minimum_distance(wave, np.array([0.5, 2.0, 1.0])))
    yield "formula and cubic", _of_separation(minimum_distance(wave, random_curve(rng, "cubic", 3), 1e-8))
    for kind in ("cubic", "quintic"):
        found = enclosure(random_curve(rng, kind, 3), 0.2, 0.5)
        yield f"enclosure of a {kind}", {"support": found.support(rng.normal(size=(5, 3)))}


def batches():
    """Collisions of many curves with many hulls."""
    rng = np.random.default_rng(7)
    curves, hulls = rng.random((40, 4, 3)), [rng.random((5, 3)) + 0.7 * rng.normal(size=3) for _ in range(30)]
    for clearance in (0.0, 0.1):
        yield f"collisions, {clearance}", {"table": collisions(curves, hulls, clearance).astype(int)}


def pairs():
    """Extremal pairs and their derivatives."""
    for name, made in {"domes": scenes.dome_pairs(4), "tori": scenes.torus_pairs(4, 0.1)}.items():
        for k, ((f, g), (q_f, q_g)) in enumerate(zip(made.surfaces, made.q, strict=True)):
            pair = extremal_pair(f, q_f, g, q_g)
            numbers = {"status": pair.status.name, "parameters": pair.parameters, "gap": pair.gap}
            for of in (contact_jacobian, gap_gradient, gap_hessian):
                numbers[of.__name__] = of(f, q_f, g, q_g, pair.parameters)
            yield f"pair of {name} {k}", numbers


def features():
    """The closest features of solids, wherever they are."""
    shapes = {
        "box": asm.shapes.box(1.0, 0.8, 0.6),
        "cylinder": asm.shapes.solid_cylinder(0.4, 1.0),
        "plate": asm.shapes.plate(2.0, 2.0, 0.3, holes=[(0.1, 0.2, 0.4)]),
        "cone": (asm.Face(asm.shapes.cone(0.5, 1.0)),),
    }
    rng = np.random.default_rng(8)
    for a, b in ((a, b) for a in shapes for b in shapes):
        q = np.concatenate([rng.uniform(0.8, 1.6, 3), rng.normal(size=4)])
        pair = closest_features(shapes[a], shapes[b], q_b=q / np.r_[1, 1, 1, np.full(4, np.linalg.norm(q[3:]))])
        yield (
            f"{a} and {b}",
            {
                "status": pair.status.name,
                "features": str(pair.features),
                "gap": pair.gap,
                "lower": pair.lower,
                "points": pair.points,
            },
        )
