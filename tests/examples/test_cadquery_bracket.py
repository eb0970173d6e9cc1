"""The example of the bracket: its foot lies on the plate, hole over hole, and CadQuery has it there."""

from __future__ import annotations

import numpy as np
import pytest

from tests.examples.running import run_example

pytest.importorskip("cadquery", reason="needs CadQuery, in an environment of its own: packaging/check_cad.py")

from tests.cad.residuals import moved  # noqa: E402  # it is of cadquery's objects


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return run_example("cadquery_bracket", tmp_path_factory.mktemp("cadquery_bracket"))


def test_the_bracket_stands_on_the_plate_over_its_hole(run):
    assembly, solution = run.result
    assert solution.success and solution.mobility.dof == 0
    turn, shift = moved(assembly, "bracket")
    # The lowest points of the bracket are its foot, at z = 0 of its own.
    assert turn[:, 2] == pytest.approx([0, 0, 1], abs=1e-11) and shift[2] == pytest.approx(4, abs=1e-10)
    own = assembly.objects["bracket"].obj.faces("%CYLINDER").val()._geomAdaptor().Cylinder().Axis().Location()
    assert (turn @ [own.X(), own.Y(), own.Z()] + shift)[:2] == pytest.approx([15, 10], abs=1e-10)
    assert np.degrees(np.arctan2(turn[1, 0], turn[0, 0])) == pytest.approx(np.degrees(0.5), abs=1e-9)


def test_it_tells_where_the_bracket_is(run):
    assert run.lines == [line for line in run.lines if "every constraint holds" in line]
