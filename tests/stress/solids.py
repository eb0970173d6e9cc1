"""Random solids drawn to a point under a clearance, judged by Coal (extra `bench`): ``python -m tests.stress.solids``.

    python -m tests.stress.solids [COUNT [SEED]]

Boxes, plates, cylinders, balls and ellipsoids, two to four of them, apart at the start. Says how solves end, and names
those that end with bodies in each other; fails where one of these is SOLVED.
"""

from __future__ import annotations

import sys
from collections import Counter

import coal
import numpy as np
from scipy.spatial.transform import Rotation

import assembly as asm

SHAPES = {
    "box": (asm.shapes.box(1.0, 0.8, 0.6), coal.Box(1.0, 0.8, 0.6)),
    "ball": (asm.shapes.sphere(0.5), coal.Sphere(0.5)),
    "plate": (asm.shapes.box(3.0, 3.0, 0.1), coal.Box(3.0, 3.0, 0.1)),
    "cylinder": (asm.shapes.solid_cylinder(0.4, 1.0), coal.Cylinder(0.4, 1.0)),
    "ellipsoid": (asm.shapes.ellipsoid(0.3, 0.5, 0.7), coal.Ellipsoid(0.3, 0.5, 0.7)),
}
# Distances are good to this; bodies that are in each other by less only touch.
TOUCHING = 1e-6
# What Coal says where its method fails, of bodies that touch or are deep in each other; if they touch, a coarser
# tolerance helps.
FAILED = -1e300


def distance(f, g):
    """The signed distance of two shapes at their places."""
    request = coal.DistanceRequest()
    for tolerance in (1e-10, 1e-8):
        request.gjk_tolerance = request.epa_tolerance = tolerance
        found = coal.distance(*f, *g, request, coal.DistanceResult())
        if found > FAILED:
            break
    return found


def least(names, q):
    """The least signed distance of any two."""
    turns = Rotation.from_quat(q[:, 3:], scalar_first=True).as_matrix()
    placed = [
        (SHAPES[name][1], coal.Transform3s(turn, pose[:3])) for name, turn, pose in zip(names, turns, q, strict=True)
    ]
    return min(distance(placed[i], placed[j]) for i in range(len(names)) for j in range(i))


def scene_of(rng):
    """Names, and bodies that are apart, all but the first one drawn to a point."""
    names = [list(SHAPES)[k] for k in rng.integers(0, len(SHAPES), rng.integers(2, 5))]
    q = np.zeros((len(names), 7))
    while True:
        q[:, :3] = rng.uniform(-1.6, 1.6, (len(names), 3))
        q[:, 3:] = Rotation.random(len(names), random_state=int(rng.integers(1 << 30))).as_quat(scalar_first=True)
        q[0] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
        if least(names, q) > 0.02:
            break
    bodies = [
        asm.Body(f"{name} {k}", SHAPES[name][0], q[k, :3], q[k, 3:], fixed=k == 0) for k, name in enumerate(names)
    ]
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Clearance())
    target = rng.uniform(-1.0, 1.0, 3) if rng.random() < 0.5 else np.zeros(3)
    scene.minimize(*[asm.PointDistance(body.point(*(0.2 * rng.normal(size=3))), target) for body in bodies[1:]])
    return names, scene


def main(count=360, seed=0):
    """Print how solves end; how many are SOLVED with bodies in each other."""
    ends, wrong = Counter(), 0
    for number in range(count):
        names, scene = scene_of(np.random.default_rng([seed, number]))
        solution = scene.solve()
        distance = least(names, solution.q)
        ends[solution.status.name] += 1
        if distance < -TOUCHING:
            wrong += solution.success
            print(
                f"scene {number}, {', '.join(names)}: {solution.status.name}, {distance:.2g} in each other", flush=True
            )
    print(", ".join(f"{many} {end}" for end, many in ends.most_common()))
    return wrong


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:])) > 0)
