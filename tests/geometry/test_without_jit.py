from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

PROGRAM = """
import json, sys
import numpy as np
from assembly.geometry import shapes
from assembly.geometry.splines.curve import NurbsCurve
from assembly.geometry.splines.surface import NurbsSurface

rng = np.random.default_rng(0)
knots = [0, 0, 0, 0, 0, 0.4, 1, 1, 1, 1, 1]
surfaces = [
    shapes.torus(4.0, 1.0),
    shapes.paper_clip(),
    NurbsSurface(rng.normal(size=(6, 4, 3)), (knots, [0, 0, 0, 1, 2, 2, 2]), (4, 2), rng.uniform(0.5, 2.0, (6, 4))),
]
out = []
for surface in surfaces:
    u, v = (a + (b - a) * np.array([0.0, 0.13, 0.5, 0.77, 1.0]) for a, b in surface.domain)
    out.append([x.tolist() for x in surface.evaluate(u, v[::-1], 2)])
    out.append(surface.packed()[1][-9:].tolist())
out.append(surfaces[0].evaluate(-1.0, 40.0).tolist())
curve = NurbsCurve(rng.normal(size=(6, 2)), knots, 4, rng.uniform(0.5, 2.0, 6))
out.append([x.tolist() for x in curve.evaluate([0.0, 0.1, 0.4, 1.0], 2)])
refused = []
for u, v in ((np.nan, 0.0), (0.0, np.inf), (0.0, 99.0), (-1.0, 0.0)):
    try:
        surfaces[2].evaluate(u, v)
    except ValueError as error:
        refused.append(str(error))
json.dump([out, refused], sys.stdout)
"""


def run(disable):
    environment = {**os.environ, "NUMBA_DISABLE_JIT": disable}
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", PROGRAM],
        env=environment,
        cwd=Path(__file__).parents[2],
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def flat(x):
    return [z for y in x for z in flat(y)] if isinstance(x, list) else [x]


def test_plain_python_gives_the_numbers_of_the_compiled_kernels():
    (compiled, refused), (plain, refused_plain) = run("0"), run("1")
    for a, b in zip(compiled, plain, strict=True):
        a, b = np.array(flat(a)), np.array(flat(b))
        # The compiled kernels fuse multiplications with additions: some roundings less, in sums as large as
        # the largest derivative.
        np.testing.assert_allclose(a, b, rtol=1e-14, atol=4e-15 * np.abs(b).max())
    assert refused == refused_plain and len(refused) == 4
