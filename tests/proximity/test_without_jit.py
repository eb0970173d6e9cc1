"""The kernels as plain Python: the same pairs and the same derivatives."""

from __future__ import annotations

import json
from functools import partial
from unittest import mock

import numpy as np
import pytest

import assembly as asm
from assembly.geometry import shapes
from assembly.geometry.faces.face import Face
from assembly.proximity import contact_jacobian, extremal_pair, gap_gradient, gap_hessian
from assembly.proximity.bvh.facet_tree import FacetTree
from benchmarks.watching import Watch


def pairs():
    q_f = np.array([0.1, -0.2, 0.3, 0.9, 0.1, -0.3, 0.4])
    torus, egg = shapes.torus(3.0, 1.0), Face(shapes.ellipsoid(1.0, 2.0, 1.5), reversed=True)
    plane, pipe = shapes.plane(9.0, 9.0), shapes.cylinder(1.0, 4.0)
    scenes = [
        (torus, q_f, egg, [6.0, 1.0, 2.0, 1.0, 0.2, 0.1, 0.4], None),
        (torus, q_f, torus, [5.0, 1.0, 4.0, 0.5, 0.2, 0.1, -2.4], None),
        (torus, q_f, egg, [4.2, 1.0, 2.0, 1.0, 0.2, 0.1, 0.4], (0.5, 0.5, 5.0, 3.0)),
        (plane, [0, 0, 0, 1, 0, 0, 0], pipe, [0.1, 0.2, 1.5, 0.5, 0.0, 0.5, 0.0], (0.5, 0.3, 0.3, 2.0)),
        (plane, [0, 0, 0, 1, 0, 0, 0], plane, [20.0, 0.2, 1.5, 0.5, 0.0, 0.5, 0.0], (0.5, 0.3, 0.3, 2.0)),
    ]
    out = []
    for f, p, g, q, start in scenes:
        pair = extremal_pair(f, p, g, q, start)
        row = [pair.status.name, pair.parameters.tolist(), pair.points.tolist(), pair.normal.tolist(), pair.gap]
        if pair.status.name in ("CONVERGED", "SINGULAR"):
            derivatives = (contact_jacobian, gap_gradient, gap_hessian)
            row += [function(f, p, g, q, pair.parameters).tolist() for function in derivatives]
        out.append(row)
    return out


def looks():
    clip, ring = asm.shapes.paper_clip(), asm.shapes.torus(5.0, 0.5)
    here = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]
    out = []
    for wires, poses in (
        ([clip, clip], [[0.3, 1.1, -20.0, 0.9, 0.2, 0.3, 0.1], [0.4, 1.2, 0.3, 1.0, 0.02, 0.0, 0.01]]),
        ([ring, ring], [[0.3, 0.1, 1.2, 1.0, 0.01, 0.05, 0.0], [4.2, 0.1, 0.3, 0.7, 0.7, 0.0, 0.1]]),
    ):
        # Coarse trees: plain Python takes some milliseconds for each patch.
        with mock.patch.object(FacetTree, "of", partial(FacetTree.of, angle=0.7)):
            watch = Watch(wires)
        for row in poses:
            q = np.array([here, row])
            q[1, 3:] /= np.linalg.norm(q[1, 3:])
            watch.forget()
            listed = watch.look(q)
            order = np.argsort(listed.gap)
            out.append([listed.gap[order].tolist(), listed.take.tolist()])
    return out


@pytest.fixture(scope="module")
def plain(run_python):
    """What both are without compilation."""
    code = "import json; from tests.proximity.test_without_jit import *; print(json.dumps([pairs(), looks()]))"
    return json.loads(run_python(code, NUMBA_DISABLE_JIT="1"))


def test_plain_python_gives_the_same_pairs(plain):
    statuses = [row[0] for row in plain[0]]
    assert statuses[:2] == ["CONVERGED", "CONVERGED"] and statuses[3] == "SINGULAR"
    for a, b in zip(pairs(), plain[0], strict=True):
        assert a[0] == b[0] and len(a) == len(b)
        for x, y in zip(a[1:], b[1:], strict=True):
            # Without fused multiply-add: other roundings, amplified by the solve.
            np.testing.assert_allclose(y, x, rtol=0.0, atol=1e-12 * (1.0 + np.abs(x).max()))


def test_plain_python_lists_the_same_contacts_of_wires(plain):
    compiled = looks()
    assert sum(len(gaps) for gaps, _ in compiled) > 5
    for (gaps, take), (others, allowed) in zip(compiled, plain[1], strict=True):
        np.testing.assert_allclose(others, gaps, rtol=0.0, atol=1e-11)
        np.testing.assert_allclose(allowed, take, rtol=1e-9)
