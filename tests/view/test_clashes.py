"""Reports of interference in pictures: what crosses is red, and every row has its place."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.view.picture import draw

RED, FAINT = (0.90, 0.10, 0.10), (0.72, 0.74, 0.78)


@pytest.fixture(scope="module")
def report():
    ball = asm.shapes.sphere(0.5)
    places = {"a": 0.0, "b": 0.9, "c": 1.9, "d": 3.1, "e": 6.0}
    # Colors of their own give way.
    bodies = [asm.Body(name, ball, (x, 0.0, 0.0), color=(0.0, 0.0, 1.0)) for name, x in places.items()]
    scene = asm.Assembly([*bodies, asm.Body("ground", fixed=True)])
    return asm.interference(scene, margin=0.5)


def items(picture, *path):
    return [item for item in picture.items if item.path[: len(path)] == path]


def test_what_crosses_is_red(report):
    picture = draw(report.scene, interference=report)
    colors = {item.path[1]: (item.color, item.opacity < 1.0) for item in items(picture, "bodies")}
    # Faint and red alike let places inside be seen.
    assert colors["a"] == colors["b"] == (RED, True)
    assert colors["c"] == colors["d"] == colors["e"] == (FAINT, True)
    # Without a report they are as they were.
    assert {item.color for item in draw(report.scene).items if item.path[1] == "a"} == {(0.0, 0.0, 1.0)}


def test_every_row_has_its_place(report):
    picture = draw(report.scene, interference=report)
    assert [row.bodies for row in report] == [("a", "b"), ("b", "c"), ("c", "d")]
    first = items(picture, "bodies", "a")[0]
    scale = float(first.scale[0])
    for row in report:
        name = " / ".join(row.bodies)
        marks = [items(picture, "places", name, label)[0] for label in ("point", "other point")]
        assert all(mark.in_front for mark in marks)
        between = marks[1].position - marks[0].position
        # The picture's scale, then rounding of numbers near one.
        assert between == pytest.approx(scale * (row.points[1] - row.points[0]), abs=1e-13)
    # A rod where there is room for one.
    assert [row.gap for row in report] == pytest.approx([-0.1, 0.0, 0.2], abs=1e-12)
    assert len(items(picture, "places", "c / d", "between")) == 1
    assert len(items(picture, "places", "b / c", "between")) == 0
    kinds = [items(picture, "places", " / ".join(row.bodies), "point")[0].color for row in report]
    assert len(set(kinds)) == 3


def test_bodies_stand_where_the_report_was_made(report):
    q = report.q.copy()
    q[:, 1] += np.arange(6.0)
    moved = asm.interference(report.scene, q, margin=0.5)
    picture = draw(report.scene, interference=moved)
    a, b = (items(picture, "bodies", name)[0].matrix[:3, 3] for name in "ab")
    assert (b - a)[1] / (b - a)[0] == pytest.approx(1.0 / 0.9, abs=1e-12)


def test_excluded_pairs_are_not_red():
    ball = asm.shapes.sphere(0.5)
    a, b = asm.Body("a", ball), asm.Body("b", ball, (0.9, 0.0, 0.0))
    scene = asm.Assembly([a, b])
    scene.constrain(asm.Clearance(exclude=[(a, b)]))
    picture = draw(scene, interference=asm.interference(scene))
    assert {item.color for item in items(picture, "bodies")} == {FAINT}


def test_undecided_rows_have_no_place(report):
    undecided = asm.interference(report.scene, margin=0.5, time_limit=1e-9)
    assert items(draw(report.scene, interference=undecided), "places") == []


def test_what_is_no_report_of_the_scene_is_refused(report):
    other = asm.Assembly([asm.Body("a", asm.shapes.sphere(0.5)), asm.Body("b", asm.shapes.sphere(0.5))])
    with pytest.raises(asm.errors.InputError, match="interference is a report of another scene"):
        draw(other, interference=report)
    with pytest.raises(TypeError, match="interference is 3; expected an Interference, or None"):
        draw(other, interference=3)
    with pytest.raises(asm.errors.InputError, match="solution and interference are both given"):
        draw(report.scene, report.scene.solve(), interference=report)


def test_a_report_plots_itself(report, monkeypatch):
    shown = []
    monkeypatch.setattr("assembly.view.show", lambda *scene, **options: shown.append((scene, options)))
    report.plot(open=True)
    assert shown == [((report.scene,), {"open": True, "interference": report, "visualizer": None})]
