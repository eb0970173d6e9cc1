"""The figures of paper 000: numbers of the script against the closest points themselves, and its picture."""

from __future__ import annotations

from importlib.util import find_spec, module_from_spec, spec_from_file_location

import numpy as np
import pytest

from tests.examples.running import EXAMPLES


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    spec = spec_from_file_location("patoglu_gillespie", EXAMPLES / "papers" / "patoglu_gillespie.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    folder = tmp_path_factory.mktemp("patoglu_gillespie")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        result = module.main()
    pictures = ["patoglu_gillespie.png"] if find_spec("matplotlib") else []
    assert [path.name for path in folder.iterdir()] == pictures
    result.module = module
    return result


def test_figure_6(run):
    six = run.six
    begins = run.module.changes(six.mode[:, 0].tolist())
    assert six.mode[begins, 0].tolist() == [0, 1, 0]
    # On the way along u = 0, and to the closest of a dense grid of points.
    assert np.all(six.parameters[begins[1] : begins[2], 0] == 0.0)
    t = np.linspace(0.0, 1.0, 1001)
    dense = np.linalg.norm(run.module.PATCH.evaluate(t[:, None], t[None, :]) - (0.175, 8.011, 4.576), axis=2)
    assert six.distance[-1] <= dense.min() < six.distance[-1] + 1e-4
    assert np.diff(six.distance).max() < 1e-13


def test_figure_7(run):
    counts = {method: int(right.sum()) for method, right in run.seven.items()}
    # Starts on the border of a region may fall on either side by a rounding.
    assert abs(counts["newton"] - 121) <= 3 and abs(counts["newton_saturated"] - 386) <= 3
    assert counts["controller"] == 441


def test_figure_8(run):
    lag = {key: r.error[5_000:].max() for key, r in run.eight.items()}
    assert lag[0.02, False] > 1.0 and lag[1300.0, False] > 5.0  # slow, and chattering
    assert abs(lag[50.0, False] - 1.782e-2) < 1e-4 and lag[50.0, True] < 1e-6
    assert abs(lag[1250.0, False] * 1250.0 / (lag[50.0, False] * 50.0) - 1.0) < 0.01


def test_figure_9(run):
    nine = run.nine
    begins = run.module.changes(nine.features)
    names = [nine.features[k] for k in begins]
    assert names[0] == "face 'top'" and names[2:] == ["face 'right'"]
    assert names[1].startswith("edge") and "'top' | 'right'" in names[1]
    # The controller knows only the top: while that is closest it agrees, and then it waits at the edge.
    top = slice(0, begins[1])
    # Feed-forward Euler steps of 1/400 leave a lag of a thousandth.
    assert np.abs(nine.top[top] - nine.parameters[top]).max() < 5e-3
    assert set(nine.modes[: begins[1] - 2]) == {"interior"} and set(nine.modes[begins[1] + 2 :]) == {"edge"}
    # The edge's normals fan out from the top's to the wall's: there x = 1 and z is between.
    angle = np.linspace(np.radians(-10.0), np.radians(110.0), len(nine.features))
    crossing = angle[begins[2]]
    assert abs(2.4 * np.cos(crossing) - 0.7) < 0.05  # level with the edge near y = 0, z = 0.7
