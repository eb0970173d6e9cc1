"""No kernel reads numbers of its work space that it has not written: results are the same whatever stood there before.

Kernels run as plain Python here, where `numpy.empty` can be given numbers to begin with.
"""

from __future__ import annotations

import pytest

CODE = """
import numpy as np

plain, fill = np.empty, float("{fill}")


def empty(*arguments, **options):
    array = plain(*arguments, **options)
    array.fill(fill if array.dtype.kind == "f" else 0)
    return array


np.empty = empty

import assembly as asm
from benchmarks import hands, linkages
from tests.laws.trim_scenes import trim_scene
from tests.recorded.solves import of_solution

scenes = [linkages.four_bar()[0], hands.ball_in_bowl().scene, linkages.boxes(3, seed=1)]
for loop in ("circle", "polygon"):
    for form in ("signed", "parametric", "cartesian", "between"):
        scenes.append(trim_scene(2, "ellipsoid", loop, "a", form).scene)
box, ball = (asm.Body(n, s, p, fixed=n == "box") for n, s, p in (
    ("box", asm.shapes.box(2, 2, 1), (0, 0, 0)), ("ball", asm.shapes.sphere(0.5), (0.2, 0.1, 1.5))))
apart = asm.Assembly([box, ball])
apart.constrain(asm.Clearance(minimum=0.1))
apart.minimize(asm.PointDistance(ball.point(0.1, 0, 0), (0.3, 0.2, 0.2)))
scenes.append(apart)
for scene in scenes:
    for name, value in of_solution(scene.solve()).items():
        print(name, value if isinstance(value, str) else [float(x).hex() for x in np.ravel(value)])
"""


@pytest.fixture(scope="module")
def told(run_python):
    """What solves print that begin with zeros."""
    return run_python(CODE.format(fill="0"), NUMBA_DISABLE_JIT="1")


@pytest.mark.parametrize("fill", ["1e5", "nan"])
def test_solves_do_not_depend_on_what_stood_in_their_work_space(run_python, told, fill):
    assert told.count("SOLVED") == 12
    assert run_python(CODE.format(fill=fill), NUMBA_DISABLE_JIT="1") == told
