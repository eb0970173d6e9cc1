"""Selector strings: what each chooses, against brute force over centers, normals and kinds of faces and edges."""

from __future__ import annotations

import re
from itertools import product

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError

STEPS = asm.curves.polygon([(0, 0), (4, 0), (4, 1), (2, 1), (2, 2), (0, 2)])
AXES = {"X": (1, 0, 0), "Y": (0, 1, 0), "Z": (0, 0, 1), "XY": (1, 1, 0), "XZ": (1, 0, 1), "YZ": (0, 1, 1)}
AXES["(1, -2, 0.5)"] = (1, -2, 0.5)


def body():
    """Steps with a hole: planes that face the same way at several heights, and edges of every kind."""
    steps = asm.shapes.extrusion(STEPS, 3, [asm.curves.circle(0.4, (1, 1))])
    return asm.Body("steps", asm.shapes.joined(steps=steps, ball=asm.shapes.sphere(0.3), cone=asm.shapes.cone(1, 2)))


BODY = body()
THINGS = {"faces": BODY.faces, "edges": BODY.edges}


def normal(thing):
    """What a thing is compared by with a direction, found without selectors."""
    if thing.kind == "plane":
        (a, b), (c, d) = thing.face.surface.domain
        return thing.face.normal(0.5 * (a + b), 0.5 * (c + d))
    if thing.kind == "line":
        ends = thing.at(thing.domain)
        return (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
    return None


def cosine(thing, axis):
    n = normal(thing)
    return None if n is None else float(n @ axis) / float(np.linalg.norm(axis))


def center(thing):
    """Its centroid; tests of faces and edges compare these with samples and formulas."""
    return thing.centroid


def groups(things, axis):
    """Things by heights, the lowest first."""
    heights = {thing: float(center(thing) @ np.array(axis) / np.linalg.norm(axis)) for thing in things}
    found = []
    for thing in sorted(things, key=heights.get):
        if found and heights[thing] - heights[found[-1][0]] < 1e-4:
            found[-1].append(thing)
        else:
            found.append([thing])
    return found


def brute(things, selector):
    """What a simple selector chooses."""
    sign, name, index = re.fullmatch(r"(>>|<<|[><|#+-]|%)(\([^)]*\)|\w+)(?:\[(-?\d+)\])?", selector).groups()
    if sign == "%":
        return {thing for thing in things if thing.kind.upper() == name}
    axis = np.array(AXES[name], dtype=float)
    if sign in "|#+-" and len(sign) == 1:
        test = {
            "|": lambda c: abs(abs(c) - 1) < 1e-9,
            "#": lambda c: abs(c) < 1e-6,
            "+": lambda c: abs(c - 1) < 1e-9,
            "-": lambda c: abs(c + 1) < 1e-9,
        }[sign]
        return {thing for thing in things if (c := cosine(thing, axis)) is not None and test(c)}
    among = brute(things, f"|{name}") if index is not None and len(sign) == 1 else set(things)
    found = groups([thing for thing in things if thing in among], axis)
    if sign[0] == "<":
        found.reverse()
    return set(found[-1 if index is None else int(index)]) if found else set()


SIMPLE = [f"{sign}{axis}" for sign, axis in product((">", "<", ">>", "<<", "|", "#"), AXES)]
SIMPLE += [f"{sign}{axis}[{k}]" for sign, axis, k in product((">", "<", ">>", "<<"), "XYZ", (0, 1, -1, -2))]
KINDS = {"faces": ("PLANE", "CYLINDER", "CONE", "SPHERE", "TORUS"), "edges": ("LINE", "CIRCLE")}


@pytest.mark.parametrize("selector", SIMPLE)
@pytest.mark.parametrize("what", THINGS)
def test_simple_selectors(what, selector):
    things = THINGS[what]
    try:
        expected = brute(things, selector)
    except IndexError:
        with pytest.raises(InputError, match="asks for place"):
            things(selector)
    else:
        assert set(things(selector)) == expected
        assert list(things(selector)) == [thing for thing in things if thing in expected]  # in the body's order


@pytest.mark.parametrize("what", THINGS)
def test_kinds(what):
    for kind in KINDS[what]:
        assert (
            set(THINGS[what](f"%{kind}")) == brute(THINGS[what], f"%{kind}") == set(THINGS[what](f"% {kind.lower()}"))
        )
    assert len(BODY.faces("%CONE")) == len(BODY.faces("%SPHERE")) == 1 and not BODY.faces("%BSPLINE")


@pytest.mark.parametrize("axis", AXES)
def test_senses_of_planes(axis):
    for sign in "+-":
        assert set(BODY.faces(f"{sign}{axis}")) == brute(BODY.faces, f"{sign}{axis}")
    assert BODY.faces(axis) == BODY.faces(f"+{axis}")


@pytest.mark.parametrize("seed", range(40))
def test_words_and_parentheses(seed):
    """Random expressions, against Python's own sets. "and" binds first, then "or", "exc"; "not" takes the rest."""
    rng = np.random.default_rng(seed)
    what = ("faces", "edges")[seed % 2]
    things = THINGS[what]
    simple = [">Z", "<Y", "|X", "|Z", "#Y", ">>X[0]", ">(1, -2, 0.5)", *(f"%{kind}" for kind in KINDS[what][:2])]

    def atom(depth, last):
        if last and rng.random() < 0.3:
            text, chosen = expression(max(depth - 1, 0))
            return f"not {text}", set(things) - chosen
        if depth and rng.random() < 0.4:
            text, chosen = expression(depth - 1)
            return f"({text})", chosen
        text = str(rng.choice(simple))
        return text, brute(things, text)

    def several(part, word, joined, last):
        count = rng.integers(1, 3)
        texts, sets = zip(*(part(last and k == count - 1) for k in range(count)), strict=True)
        return f" {word} ".join(texts), joined(*sets)

    def expression(depth):
        def terms(last):
            return several(lambda last: atom(depth, last), "and", set.intersection, last)

        def operand(last):
            return several(terms, "or", set.union, last)

        return several(operand, rng.choice(["exc", "except"]), set.difference, True)

    text, chosen = expression(2)
    assert set(things(text)) == chosen, text


def test_vertices():
    cube = asm.Body("cube", asm.shapes.box(2, 4, 6))
    assert [vertex.center.tolist() for vertex in cube.vertices(">X and >Y and <Z")] == [[1, 2, -3]]
    assert len(cube.vertices("<X")) == 4 and len(cube.vertices(">(1, 1, 1)")) == 1 and not cube.vertices("|X")
    assert len(cube.vertices(">XY")) == 2


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "expected one of > < >> << | # + - %"),
        ("Q", "expected one of > < >> << | # + - %, or a direction"),
        (">", "expected a direction, X, Y, Z, XY, XZ, YZ or (x, y, z) at its end"),
        (">(1, 2)", "expected a direction"),
        (">(0, 0, 0)", "expected one that is finite and not 0"),
        (">Z[x]", "expected 'and', 'or', 'exc' or the end at '[x]'"),
        (">Z <X", "expected 'and', 'or', 'exc' or the end at '<X'"),
        (">Z and", "expected one of"),
        (">Z not <X", "expected 'and', 'or', 'exc' or the end at 'not <X'"),
        (">Z and not", "or a direction, X, Y, Z, XY, XZ, YZ or (x, y, z) at its end"),
        ("(>Z", "expected ')' at its end"),
        ("%", "expected the name of a kind"),
        ("%FOO", "with kind FOO; expected one of PLANE, CYLINDER"),
        ("top", "with the view 'top', which is '>Y' in CadQuery"),
        (">Z[9]", "asks for place 9; expected one of"),
    ],
)
def test_what_cannot_be_read_says_what_was_expected(text, expected):
    with pytest.raises(InputError, match=re.escape(expected)):
        BODY.faces(text)


def test_edges_have_no_sense():
    for text in ("+X", "-X", "X", "|X and +X"):
        with pytest.raises(InputError, match=re.escape("expected '|' for edges")):
            BODY.edges(text)


@pytest.mark.parametrize("text", ["not " * 4000 + "|Z", "(" * 4000 + "|Z" + ")" * 4000])
def test_strings_that_nest_without_end(text):
    box = asm.Body("box", asm.shapes.box(1, 2, 3))
    with pytest.raises(InputError, match="selector nests more than 50 times"):
        box.faces(text)
    assert len(box.faces("(" * 40 + "|Z" + ")" * 40)) == 2
