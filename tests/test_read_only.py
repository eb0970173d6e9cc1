"""Arrays of public objects: what changes nothing when it is written to cannot be written to."""

from __future__ import annotations

import copy
import dataclasses
import pickle
import warnings
from collections.abc import Callable, Iterator, Mapping
from enum import Enum
from typing import Any

import casadi
import numpy as np
import pytest

import assembly as asm
from assembly.proximity.brep.topology import topology_of
from assembly.proximity.bvh.facet_tree import FacetTree

STILL = (1.0, 0.0, 0.0, 0.0)


def arrays_of(value: Any, path: str, seen: dict[int, Any]) -> Iterator[tuple[str, np.ndarray]]:
    """Every array that public attributes of a value lead to, with how."""
    if isinstance(value, np.ndarray):
        yield path, value
    elif id(value) in seen or isinstance(value, (str, bytes, int, float, Enum, type(None))):
        return
    seen[id(value)] = value
    if isinstance(value, (tuple, list, set, frozenset)):
        for k, item in enumerate(value):
            yield from arrays_of(item, f"{path}[{k}]", seen)
    elif isinstance(value, Mapping):
        for key, item in value.items():
            yield from arrays_of(item, f"{path}[{key!r}]", seen)
    elif type(value).__module__.startswith("assembly."):
        # Dataclasses may make fields when they are read.
        fields = {field.name for field in dataclasses.fields(value)} if dataclasses.is_dataclass(value) else set()
        for name in sorted(fields | set(dir(value))):
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DeprecationWarning)  # of attributes that have another name now
                try:
                    got = getattr(value, name) if name[0] != "_" else None
                except asm.errors.InputError:
                    continue  # what there is not, as the volume of an open body
            if not callable(got):
                yield from arrays_of(got, f"{path}.{name}", seen)


def ball_on_plane() -> asm.Assembly:
    ground = asm.Body("ground", asm.shapes.plane(10, 10), fixed=True)
    ball, arm = asm.Body("ball", asm.shapes.sphere(1.0), (0.1, 0.2, 1.5)), asm.Body("arm", position=(4, 0, 0))
    scene = asm.Assembly([ground, ball, arm])
    hinge = asm.Revolute(ground.frame((4, 0, 0)), arm, "hinge", axes="opposed")
    scene.constrain(asm.Contact(ground, ball), asm.Clearance(name="off", exclude=[(ground, ball)]), hinge)
    scene.minimize(asm.PointDistance(ball.point(0, 0, 0), (1, 0, 1)), asm.Posture(scene.q, weight=1e-3))
    scene.minimize(asm.FrameDistance(arm, asm.Pose((4, 0, 0)), weight=0.1))
    scene.maximize(asm.Dexterity(arm.point(1, 0, 0), [hinge], "force_transmission", direction=(0, 1, 0), weight=1e-4))
    return scene


def solution() -> asm.Solution:
    found = ball_on_plane().solve()
    assert found.success
    return found


def tracked() -> tuple[asm.Tracker, asm.Step]:
    ball = asm.Body("ball", asm.shapes.sphere(1.0))
    tracker = asm.Assembly([ball]).tracker(ball.point(0, 0, 1))
    return tracker, tracker.step((0.1, 0, 1))


def log() -> asm.TrackLog:
    tracker, _ = tracked()
    return tracker.run(asm.Trace([0, 0.01, 0.02], [(0, 0, 1), (0.1, 0, 1), (0.2, 0, 1)]))


def manager() -> asm.Manager:
    made = asm.Manager([asm.Body("a", asm.shapes.sphere(1.0)), asm.Body("b", asm.shapes.sphere(1.0))], reach=0.3)
    made.update([(0, 0, 0, *STILL), (2.1, 0, 0, *STILL)])
    assert made.contacts
    return made


def trimmed() -> asm.Face:
    loop = asm.NurbsCurve.polyline([(-1, -1), (1, -1), (1, 1), (-1, 1), (-1, -1)])
    return asm.Face(asm.shapes.plane(10, 10), outer=asm.Loop(loop))


def formula() -> asm.FormulaCurve:
    t = casadi.SX.sym("t")
    return asm.FormulaCurve(casadi.vertcat(t, casadi.sin(t), 0), t, (0, 2))


def line() -> asm.NurbsCurve:
    return asm.NurbsCurve.bezier([(0, 0, 1), (1, 1, 1), (2, 0, 1)])


def controller() -> Any:
    made = asm.proximity.Controller(asm.shapes.sphere(1.0), (0, 0, 3))
    return made, made.step(dt=0.1)


MAKERS: dict[str, Callable[[], Any]] = {
    "scene": ball_on_plane,
    "solution": solution,
    "mobility": lambda: ball_on_plane().mobility(solution().q),
    "tracker": lambda: tracked()[0],
    "step": lambda: tracked()[1],
    "log": log,
    "manager": manager,
    "face": trimmed,
    "body": lambda: asm.Body("cylinder", asm.shapes.solid_cylinder(1, 2), (1, 2, 3)),
    "point and frame": lambda: (asm.Body("a").point(1, 2, 3), asm.Body("a").frame((1, 2, 3), (1, 1, 1))),
    "pose": lambda: asm.Pose((1, 2, 3)),
    "line": line,
    "formula's enclosure": lambda: asm.proximity.enclosure(formula(), 0, 1),
    "ellipsoid": lambda: asm.Ellipsoid(np.zeros(3), np.eye(3), np.ones(3)),
    "topology": lambda: topology_of(asm.shapes.box(1, 2, 3)),
    "facets": lambda: FacetTree.of(tuple(asm.shapes.box(1, 2, 3))),
    "surfaces": lambda: asm.proximity.extremal_pair(
        asm.shapes.plane(9, 9), (0, 0, 0, *STILL), asm.shapes.sphere(1.0), (0, 0, 2, *STILL)
    ),
    "features": lambda: asm.proximity.closest_features(
        asm.shapes.box(1, 1, 1), asm.shapes.sphere(1.0), None, (0, 0, 3, *STILL)
    ),
    "curve pair": lambda: asm.proximity.extremal_curve_pair(
        asm.shapes.sphere(1.0), (0, 0, 0, *STILL), line(), (0, 0, 3, *STILL), (0.0, 0.0, 0.5)
    ),
    "curves": lambda: asm.proximity.minimum_distance(line(), line().transformed(translation=(0, 0, 2))),
    "curve and surface": lambda: asm.proximity.minimum_distance(line(), asm.shapes.sphere(0.1)),
    "formulas": lambda: asm.proximity.minimum_distance(formula(), line()),
    "hulls": lambda: asm.proximity.minimum_distance(np.eye(3), 2 + np.eye(3)),
    "controller": controller,
    "wrench": lambda: asm.Wrench((1, 2, 3), (4, 5, 6), (0, 0, 0, *STILL)),
    "nearest point of a boundary": lambda: trimmed().nearest_on_boundary(0.5, 0.2),
}


def same(value: Any) -> Any:
    return value


@pytest.mark.parametrize("how", [same, copy.copy, copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))])
@pytest.mark.parametrize("name", MAKERS)
def test_no_array_of_a_public_attribute_can_be_written_to(name, how):
    made = MAKERS[name]()
    if how is not same and name == "tracker":
        # `tests/test_copies.py`: it says that it is not copied.
        return
    # What was read before may be kept in a copy.
    assert list(arrays_of(made, name, {}))
    found = list(arrays_of(how(made), name, {}))
    writable = [path for path, array in found if array.flags.writeable]
    assert found and not writable
