"""What the documents say: their code runs, their links lead somewhere, their tables are those of the code."""

from __future__ import annotations

import ast
import inspect
import json
import re
import tomllib
from dataclasses import fields
from itertools import takewhile
from math import pi
from pathlib import Path

import pytest

import assembly as asm
from assembly.constraints.model import joints as joints_of_frames
from assembly.constraints.model import placements as joints_of_points
from assembly.constraints.model.dexterity import MEASURES
from assembly.kinematics.body import BodyFace
from assembly.proximity.extrema.pairs import PairStatus
from assembly.selection.edges import Edges
from assembly.selection.faces import Faces
from assembly.selection.vertices import Vertices
from assembly.solve.options import Options
from benchmarks import counts, report

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
CONCEPTS = (ROOT / "docs" / "concepts.md").read_text()
MECHANISMS = (ROOT / "docs" / "mechanisms.md").read_text()
PARTS = (ROOT / "docs" / "parts.md").read_text()
SHAPES = (ROOT / "docs" / "shapes.md").read_text()
README = (ROOT / "README.md").read_text()


def blocks(path):
    """The Python blocks of a page, each after as many empty lines as stand above it, so that errors point there."""
    text = path.read_text()
    found = re.finditer(r"^```python\n(.*?)^```", text, re.MULTILINE | re.DOTALL)
    return ["\n" * text.count("\n", 0, match.start(1)) + match[1] for match in found]


def tables(text, *heads):
    """The tables whose first cells are these, each as rows of cells without backquotes."""
    lines = iter(text.splitlines())
    for line in lines:
        if line.startswith("|") and [c.strip(" `") for c in line.strip("|").split("|")][: len(heads)] == list(heads):
            next(lines)
            found = takewhile(lambda row: row.startswith("|"), lines)
            yield [[cell.strip(" `") for cell in row.strip("|").split("|")] for row in found]


def rows(text, *heads):
    """The rows of the first of these tables."""
    for found in tables(text, *heads):
        return found
    raise AssertionError(f"no table {heads}")


def test_there_is_code_to_run():
    assert len(blocks(ROOT / "docs" / "concepts.md")) > 5 and blocks(ROOT / "README.md")


@pytest.mark.parametrize("path", [p for p in PAGES if blocks(p)], ids=lambda p: p.name)
def test_code_runs_as_it_stands(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)  # pages write files
    namespace = {"__name__": "__main__"}
    for block in blocks(path):
        exec(compile(block, path, "exec"), namespace)
    assert capsys.readouterr().out


@pytest.mark.parametrize("path", PAGES, ids=lambda p: p.name)
def test_links_lead_somewhere(path):
    targets = re.findall(r"\]\(([^)#\s]+)(?:#[^)]*)?\)", path.read_text())
    missing = [t for t in targets if "://" not in t and not (path.parent / t).exists()]
    assert missing == []


def anchors(path):
    """What headings of a page are called in links."""
    headings = re.findall(r"^#+ (.*)$", re.sub(r"```.*?```", "", path.read_text(), flags=re.S), flags=re.M)
    return {re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("path", PAGES, ids=lambda p: p.name)
def test_links_to_headings_lead_to_one(path):
    targets = re.findall(r"\]\(([\w./]*\.md)?#([^)\s]+)\)", path.read_text())
    assert [each for each in targets if each[1] not in anchors(path.parent / each[0] if each[0] else path)] == []


@pytest.mark.parametrize("path", PAGES, ids=lambda p: p.name)
def test_files_that_pages_name_exist(path):
    named = re.findall(r"`((?:assembly|tests|docs|examples|benchmarks)/[\w/.]+\.(?:py|md|png))`", path.read_text())
    written_by_benchmarks = {"docs/performance.md"}
    assert [name for name in named if not (ROOT / name).exists() and name not in written_by_benchmarks] == []


def test_statuses_and_their_remedies():
    assert [row[:2] for row in rows(CONCEPTS, "Status")] == [[s.name, s.value] for s in asm.Status]
    assert [row[0] for row in rows(CONCEPTS, "PairStatus")] == [s.name for s in PairStatus]
    derivations = (ROOT / "docs" / "derivations.md").read_text()
    assert [row[0] for row in rows(derivations, "status", "when")] == [s.name for s in asm.Status]


def test_options_and_their_defaults():
    table = [(name, ast.literal_eval(default)) for name, default, _ in rows(CONCEPTS, "option", "default")]
    assert table == [(option.name, option.default) for option in fields(Options)]


def test_joints_with_their_rows_and_freedoms():
    settings = {"Screw": {"pitch": 1.0}, "Distance": {"value": 1.0}, "Angle": {"value": 1.0}}
    joints = {cls for module in (joints_of_frames, joints_of_points) for cls in module.__all__}
    table = rows(MECHANISMS, "joint", "rows", "coordinates")
    assert {row[0] for row in table} == joints and len(table) == len(joints)
    for name, count, freedoms, _ in table:
        joint = getattr(asm, name)(asm.Body("a"), asm.Body("b"), **settings.get(name, {}))
        assert len(joint.equations) == int(count), name
        assert freedoms.replace("`", "").split(", ") == (list(joint.freedoms) or [""]), name


def made_shapes():
    """What the table of makers has, by its first cells."""
    shapes, curves = asm.shapes, asm.curves
    square = curves.polygon([(1, 0), (2, 0), (2, 1), (1, 1)])
    line = asm.NurbsCurve([[1, 0], [2, 1]], [0, 0, 1, 1], 1)
    wire = asm.NurbsCurve([[0, 0, 0], [1, 0, 0]], [0, 0, 1, 1], 1)
    box, ball, plate = shapes.box(1, 1, 1), shapes.sphere(1), shapes.plate(4, 4, 1)
    return {
        "plane(width, height)": shapes.plane(1, 1),
        "sphere(radius)": ball,
        "ellipsoid(a, b, c)": shapes.ellipsoid(1, 2, 3),
        "cylinder(radius, height)": shapes.cylinder(1, 1),
        "cone(radius, height, top_radius=0)": shapes.cone(1, 1),
        "torus(major_radius, minor_radius)": shapes.torus(2, 1),
        "pipe(path, radius)": shapes.pipe(shapes.Path().line(3), 1),
        "paper_clip()": shapes.paper_clip(),
        "loft(curves)": shapes.loft([wire, wire.transformed(translation=(0, 1, 0))]),
        "revolution(curve)` of an open curve": shapes.revolution(line),
        "revolution(profile)": shapes.revolution(square),
        "revolution(profile, angle)": shapes.revolution(square, 1.0),
        "trimmed_plane(outer, holes)": shapes.trimmed_plane(square),
        "box(x, y, z)": box,
        "solid_cylinder(radius, height)": shapes.solid_cylinder(1, 1),
        "plate(x, y, z, holes)": shapes.plate(9, 9, 1, [(0, 0, 1), (3, 0, 1)]),
        "plate_with_slot(x, y, z, length, width)": shapes.plate_with_slot(9, 9, 1, 3, 1),
        "cam(radii, height, bore)": shapes.cam([2, 2, 2, 3], 1, 1),
        "extrusion(profile, height)": shapes.extrusion(square, 1),
        "extrusion(profile, height, holes)`, two round holes": shapes.extrusion(
            curves.polygon([(-9, -9), (9, -9), (9, 9), (-9, 9)]), 1, [curves.circle(1), curves.circle(1, (4, 0))]
        ),
        "joined(plate, ball)": shapes.joined(plate, ball),
        "joined(box, box)": shapes.joined(box, box),
        "joined(base=box, boss=ball)": shapes.joined(base=box, boss=ball),
    }


def test_makers_and_their_face_names():
    table = {maker: names for maker, names in rows(SHAPES, "maker in `asm.shapes", "faces")}
    made = made_shapes()
    assert table == {maker: ", ".join(f.name for f in asm.Body("part", shape).faces) for maker, shape in made.items()}
    assert {maker.partition("(")[0] for maker in table} == {*asm.shapes.__all__} - {"Path"}


def described(maker):
    """A function or method as tables have it: its signature without types, and the first sentence of its docstring."""
    signature = inspect.signature(maker)
    known = [p.replace(annotation=p.empty) for p in signature.parameters.values() if p.name != "self"]
    text = str(signature.replace(parameters=known, return_annotation=signature.empty))
    return [
        maker.__name__ + text.replace(str(2 * pi), "2 * pi"),
        inspect.getdoc(maker).split("\n")[0].removesuffix("."),
    ]


def test_makers_of_shapes():
    """Signatures and descriptions are those of the code, and no maker is missing."""
    makers = [getattr(asm.shapes, name) for name in asm.shapes.__all__ if name != "Path"]
    of_several = [maker for maker in makers if inspect.signature(maker).return_annotation.startswith("tuple")]
    surfaces, solids = [list(found) for found in tables(SHAPES, "asm.shapes", "makes")]
    assert surfaces == [described(maker) for maker in makers if maker not in of_several]
    assert solids == [described(maker) for maker in of_several]
    methods = [method for name, method in vars(asm.shapes.Path).items() if name in ("line", "arc")]
    assert rows(SHAPES, "asm.shapes.Path", "does") == [described(method) for method in methods]


def test_makers_of_curves():
    makers = [getattr(asm.curves, name) for name in asm.curves.__all__]
    made = [[*described(maker), inspect.signature(maker).return_annotation] for maker in makers]
    assert rows(SHAPES, "asm.curves", "makes", "type") == made


def test_mates_and_what_they_take_away():
    table = rows(PARTS, "mate", "takes away")
    public = {name for name in asm.__all__ if isinstance(kind := getattr(asm, name), type) and hasattr(kind, "removes")}
    assert {row[0] for row in table} == public
    for name, count, _, axes in table:
        kind = getattr(asm, name)
        assert f"takes away {count.split()[0]} degree" in kind.__doc__
        default = inspect.signature(kind).parameters.get("axes")
        assert axes == ({None: "as it sits"}.get(default.default, default.default) if default else ""), name


def test_what_selects():
    kinds = {"body.faces": Faces, "body.edges": Edges, "all, and `body.vertices": Vertices}
    table = {row[0]: re.findall(r"(\w+)\(([^)]*)\)", row[1]) for row in rows(PARTS, "of", "methods")}
    assert table.keys() == kinds.keys()
    for what, methods in table.items():
        for name, arguments in methods:
            if name == "faces":
                continue
            had = [p for p in inspect.signature(getattr(kinds[what], name)).parameters if p != "self"]
            named = [a for a in arguments.split(", ") if a and a not in ("face", "...") and '"' not in a]
            assert had == named or '"' in arguments or "face" in arguments, name
    kinds_of_faces = [row[0] for row in rows(PARTS, "kind")]
    assert kinds_of_faces == [*Faces._kinds]
    for kind, has, _ in rows(PARTS, "kind"):
        for name in re.findall(r"`(\w+)`", f"`{has}`"):
            assert hasattr(BodyFace, name), (kind, name)


def test_extras():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    table = rows(README, "extra", "brings")
    assert sorted(row[0] for row in table) == sorted(project["optional-dependencies"])


def test_measures_of_dexterity():
    assert tuple(row[0] for row in rows(MECHANISMS, "measure")) == MEASURES


def test_readme_shows_the_example():
    """Statement by statement, in its order; the example has a function around them."""
    shown = [ast.unparse(node) for node in ast.parse(blocks(ROOT / "README.md")[0]).body]
    example = (ROOT / "examples" / "paper_clips.py").read_text()
    body = [ast.unparse(node) for node in ast.walk(ast.parse(example)) if isinstance(node, ast.stmt)]
    places = [body.index(statement) for statement in shown]
    assert places == sorted(places)


def test_figures_are_those_of_the_json():
    """Written by ``python -m benchmarks.report`` after each run, and not by hand."""
    measured = json.loads(report.RESULTS.read_text())
    block = report.block(measured)
    # A figure whose name is another one now is not left out in silence.
    assert block.count("\n| ") == len(report.TOLD) + 2
    assert report.with_block(README, block) == README
    work = json.loads(counts.STORED.read_text())
    assert report.page(measured, work) == report.PAGE.read_text()
