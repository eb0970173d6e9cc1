"""Motions that are recorded: ticks of a tracker, updates of a contact manager, tracked features, feedback."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

import assembly as asm
from assembly.proximity import Controller, FeatureTracker
from benchmarks import hands
from benchmarks.running import example


def _track(drag, way, ticks, **options):
    tracker = asm.Tracker(drag.scene, drag.grip.point, **options)
    begin = drag.hold
    for k in range(ticks):
        yield k, tracker.step(begin + way * (k + 1.0) / ticks)


def ticks():
    """Steps after a hand, every fifth of them."""
    drags = {
        "clips": (hands.paper_clips(), (4.0, 2.0, -3.0)),
        "rings": (hands.ring_chain(5), (0.3, 0.2, 0.1)),
        "ball in a bowl": (hands.ball_in_bowl(), (6.0, -3.0, 2.0)),
    }
    for name, (drag, way) in drags.items():
        for options in ({}, {"second_order": True}):
            for k, step in _track(drag, np.array(way), 25, **options):
                if k % 5 == 4:
                    yield (
                        f"tick {k} of {name}{' of second order' if options else ''}",
                        {"status": step.status.name, "q": step.q, "feasibility": step.feasibility},
                    )


def managers():
    """Contacts that are listed while bodies move."""
    shapes = {
        "rings": [asm.shapes.torus(1.0, 0.2)] * 3,
        "clips": [asm.shapes.paper_clip(33.0, 8.0, 0.5)] * 2,
        "solids": [asm.shapes.box(2.0, 1.5, 1.0), asm.shapes.solid_cylinder(0.6, 1.5), asm.shapes.sphere(0.7)],
    }
    for name, kinds in shapes.items():
        rng = np.random.default_rng(4)
        bodies = [asm.Body(f"{name} {k}", kind) for k, kind in enumerate(kinds)]
        size = max(body.size for body in bodies)
        manager = asm.Manager(bodies, reach=0.1 * size)
        at, way = (size * 0.4 * rng.normal(size=(len(bodies), 3)) for _ in range(2))
        axis = rng.normal(size=(len(bodies), 3))
        for k in range(20):
            turn = Rotation.from_rotvec(0.08 * k * axis).as_quat(scalar_first=True)
            events = manager.update(np.concatenate([at + 0.04 * k * way, turn], axis=1))
            if k % 4 == 3:
                told = [[contact.number, *contact.parameters, contact.gap] for contact in manager.contacts]
                yield (
                    f"update {k} of {name}",
                    {"events": len(events), "contacts": told, "gaps": [*manager.gaps.values()]},
                )


def features():
    """The closest features of two solids while one passes the other."""
    a, b = asm.shapes.plate(40.0, 30.0, 6.0, holes=[(5.0, 4.0, 6.0)]), asm.shapes.solid_cylinder(5.0, 12.0)
    tracker = FeatureTracker(a, b)
    for k in range(40):
        turn = Rotation.from_rotvec([0.03 * k, 0.02 * k, 0.5]).as_quat(scalar_first=True)
        pair = tracker.step(q_b=(-30.0 + 1.5 * k, 3.0, 14.0 - 0.1 * k, *turn))
        if k % 4 == 3:
            yield (
                f"features {k}",
                {"status": pair.status.name, "features": str(pair.features), "gap": pair.gap, "points": pair.points},
            )


def controllers():
    """Points that are driven to the closest ones by feedback."""
    bowl = example("ball_in_bowl").bowl()
    for form in ("unit", "covariant", "contravariant"):
        controller = Controller(bowl.surface, (3.0, 2.0, 9.0), form=form)
        yield f"controller {form}", {"parameters": controller.run(50, dt=0.01).parameters[-1]}
