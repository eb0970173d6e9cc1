"""The example of a contact drawn to places of a cam: against the plane geometry of an ellipse and a circle."""

from __future__ import annotations

from runpy import run_path

import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

import assembly as asm
from tests.examples.running import EXAMPLES


@pytest.fixture(scope="module")
def run():
    return run_path(str(EXAMPLES / "cam_contact_place.py"))


def test_it_prints_and_draws(tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib", reason="the picture is matplotlib's")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    run_path(str(EXAMPLES / "cam_contact_place.py"), run_name="__main__")
    assert "misses its line by 0.5762" in capsys.readouterr().out
    assert (tmp_path / "cam_contact_place.png").stat().st_size > 10_000


def nearest(shaft, lever):
    """The gap of the ellipse and the roller, and the ellipse's angle t at the nearest point."""
    center = np.array([-3.0, 1.8]) + 3.4 * np.array([np.cos(lever), np.sin(lever)])
    c, s = np.cos(shaft), np.sin(shaft)
    seen = np.array([[c, s], [-s, c]]) @ center

    def square(t):
        return (2.0 * np.cos(t) - seen[0]) ** 2 + (1.2 * np.sin(t) - seen[1]) ** 2

    start = np.arctan2(seen[1] / 1.2, seen[0] / 2.0)
    t = minimize_scalar(square, bounds=(start - 0.7, start + 0.7), method="bounded", options={"xatol": 1e-12}).x
    return np.sqrt(square(t)) - 0.5, t


def test_the_shaft_goes_around_with_the_target(run):
    turns = np.unwrap(run["turns"])
    assert np.isclose(turns[-1] - turns[0], -2.0 * np.pi, rtol=0, atol=1e-7)
    for shaft, lever in zip(turns[::9], run["lifts"][::9], strict=True):
        assert abs(nearest(shaft, lever)[0]) < 1e-8
    assert run["highest"].status is asm.Status.SOLVED and run["highest"].objective < 1e-20


def test_with_its_stop_it_comes_as_near_as_it_can(run):
    limited, place = run["limited"], run["place"]
    lever = limited.values["lever.angle"]
    assert limited.status is asm.Status.SOLVED and np.isclose(lever, np.mean(run["lifts"]), rtol=0, atol=1e-10)
    # All angles of the shaft at which the cam touches the roller with the lever at its stop.
    grid = np.linspace(-np.pi, np.pi, 181)
    gaps = [nearest(shaft, lever)[0] for shaft in grid]
    touching = [
        brentq(lambda shaft: nearest(shaft, lever)[0], a, b, xtol=1e-13)
        for a, b, before, after in zip(grid, grid[1:], gaps, gaps[1:], strict=False)
        if before * after < 0.0
    ]
    assert len(touching) == 4
    surface = place.face.surface
    ways = []
    for shaft in touching:
        t = nearest(shaft, lever)[1]
        point, (u, v) = np.array([2.0 * np.cos(t), 1.2 * np.sin(t), 0.0]), np.mean(surface.domain, axis=1)
        around = np.linspace(*surface.domain[0], 181)
        u = around[np.argmin(np.linalg.norm(surface.evaluate(around, np.full(181, v)) - point, axis=1))]

        def square(x, point=point, v=v):
            return float(((surface.evaluate(x, v) - point) ** 2).sum())

        u = minimize_scalar(square, bounds=(u - 0.2, u + 0.2), method="bounded", options={"xatol": 1e-12}).x
        ways.append(place.distance(u, v))
    # Where t is is known to the root of rounding.
    assert np.isclose(np.sqrt(limited.objective), min(ways), rtol=0, atol=1e-6)
    assert np.isclose(np.sqrt(limited.objective), 0.5761771751755596, rtol=0, atol=1e-8)
