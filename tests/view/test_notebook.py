"""What notebooks show: tables of results, and a scene to turn around."""

from html.parser import HTMLParser

import numpy as np
import pytest

import assembly as asm

nbclient = pytest.importorskip("nbclient")
nbformat = pytest.importorskip("nbformat")

SCENE = """
import numpy as np
import assembly as asm
ground, crank = asm.Body("ground", fixed=True), asm.Body("<crank>", asm.shapes.sphere(0.2))
scene = asm.Assembly([ground, crank])
scene.constrain(hinge := asm.Revolute(ground.frame(), crank.frame(), angle=0.3, name="hinge"))
solution = scene.solve()
tip = crank.point(1, 0, 0)
"""
CELLS = {
    "scene": "&lt;crank&gt;",
    "crank": "sphere",
    "solution": "SOLVED",
    "scene.mobility()": "0 degrees of freedom",
    "asm.sensitivity(scene, solution, of=[asm.Measure(tip, 'y')], wrt=[asm.Parameter(hinge, 'angle')])": "0.955336",
    "asm.interference(scene, solution)": "0 pairs",
    "asm.view.notebook(scene, solution, height=200)": "<iframe srcdoc=",
}


class Balance(HTMLParser):
    """Tags that are open, and the deepest nesting there was."""

    def __init__(self):
        super().__init__()
        self.open, self.seen = [], set()

    def handle_starttag(self, tag, attrs):
        self.open.append(tag)
        self.seen.add(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.fixture(scope="module")
def outputs():
    cells = [nbformat.v4.new_code_cell(text) for text in (SCENE, *CELLS)]
    book = nbformat.v4.new_notebook(cells=cells)
    nbclient.NotebookClient(book, timeout=300, startup_timeout=300, kernel_name="python3").execute()
    return {cell.source: cell.outputs[-1]["data"] for cell in book.cells[1:]}


@pytest.mark.parametrize(("cell", "shown"), CELLS.items())
def test_a_notebook_shows(outputs, cell, shown):
    html = outputs[cell]["text/html"]
    assert shown in html
    page = Balance()
    page.feed(html)
    assert page.open == [] and page.seen & {"table", "iframe", "div"}
    # The text is there as well, for terminals.
    assert outputs[cell]["text/plain"]


def test_logs_of_ticks_are_tables():
    body = asm.Body("hand")
    times = np.linspace(0.0, 1.0, 5)
    targets = [asm.Pose((t, 0.0, 0.0)) for t in times]
    log = asm.Assembly([body]).tracker(body).run(asm.Trace(times, targets))
    html = log._repr_html_()
    assert "5 ticks over 1 s" in html and "tick [us]" in html and "FOLLOWED" in html


@pytest.mark.parametrize("height", [10, 1e3, "tall"])
def test_the_height_of_a_picture_is_in_pixels(height):
    with pytest.raises((asm.errors.InputError, TypeError), match="height"):
        asm.view.notebook(asm.Body("ball", asm.shapes.sphere(1.0)), height=height)
