"""Parts made through OCCT, and what OCCT says of them."""

from __future__ import annotations

from importlib import import_module
from math import cos, pi, sin
from types import SimpleNamespace

import pytest

pytest.importorskip("OCP", reason='STEP files need OCCT: pip install "assembly-solver[step]"')

# Only where OCCT is there, which the line above asks.
from assembly.step.occt import occt, parts  # noqa: E402

_NAMES = (
    "BRepAlgoAPI",
    "BRepBuilderAPI",
    "BRepCheck",
    "BRepExtrema",
    "BRepFilletAPI",
    "BRepGProp",
    "BRepOffsetAPI",
    "BRepPrimAPI",
)
_NAMES += ("GC", "GProp", "Geom", "GeomAPI", "gp")


def _everything():
    names = dict(vars(occt()))
    for name in _NAMES:
        names.update(vars(import_module(f"OCP.{name}")))
    try:
        names["Fitted"] = import_module("OCP.collections").HArray1_gp_Pnt
    except ImportError:
        names["Fitted"] = import_module("OCP.TColgp").TColgp_HArray1OfPnt
    return SimpleNamespace(**names)


# As OCCT's names are written in the library, `o`, but of a module.
O = _everything()  # noqa: E741


def areas(shape):
    """OCCT's area, by its fixed rule and by its adaptive one.

    Neither is right for all: the fixed rule is off by up to 4e-5 where curves of many spans trim a face, and the
    adaptive one ends too early on extruded surfaces (off by 1e-2 on the pushed ellipse).
    """
    found = O.GProp_GProps(), O.GProp_GProps()
    O.BRepGProp.SurfaceProperties_s(shape, found[0])
    O.BRepGProp.SurfaceProperties_s(shape, found[1], 1e-9)
    return [each.Mass() for each in found]


def volumes(shape):
    """OCCT's volume, by its fixed rule and by its adaptive one."""
    found = O.GProp_GProps(), O.GProp_GProps()
    O.BRepGProp.VolumeProperties_s(shape, found[0])
    O.BRepGProp.VolumeProperties_s(shape, found[1], 1e-9)
    return [each.Mass() for each in found]


def off(mine, occts):
    """Relative deviation from the nearer one of OCCT's two answers."""
    return min(abs(mine / each - 1.0) for each in occts)


def faces(shape):
    return [O.as_face(face) for face in parts(shape, O.TopAbs_FACE)]


def edges(shape):
    return [O.as_edge(edge) for edge in parts(shape, O.TopAbs_EDGE)]


def point(x, y, z):
    return O.gp_Pnt(float(x), float(y), float(z))


def axis(at, along):
    return O.gp_Ax2(point(*at), O.gp_Dir(*map(float, along)))


Z = ((0, 0, 0), (0, 0, 1))


def box(x=1.0, y=2.0, z=3.0, at=(0, 0, 0)):
    return O.BRepPrimAPI_MakeBox(point(*at), x, y, z).Shape()


def cylinder(radius=2.0, height=5.0, place=Z, angle=2.0 * pi):
    return O.BRepPrimAPI_MakeCylinder(axis(*place), radius, height, angle).Shape()


def cone(bottom=2.0, top=0.0, height=5.0):
    return O.BRepPrimAPI_MakeCone(bottom, top, height).Shape()


def sphere(*arguments):
    return O.BRepPrimAPI_MakeSphere(2.0, *arguments).Shape()


def torus(*arguments):
    return O.BRepPrimAPI_MakeTorus(4.0, 1.0, *arguments).Shape()


def without(a, b):
    return O.BRepAlgoAPI_Cut(a, b).Shape()


def joined(a, b):
    return O.BRepAlgoAPI_Fuse(a, b).Shape()


def drill(radius=0.5, at=(-9, 0.2, 0.1), along=(1, 0.02, 0), length=18.0):
    return cylinder(radius, length, (at, along))


def filleted(shape, radius, which):
    made = O.BRepFilletAPI_MakeFillet(shape)
    for edge in which:
        made.Add(radius, edge)
    return made.Shape()


def spline(*points, periodic=False):
    given = O.Fitted(1, len(points))
    for k, each in enumerate(points, 1):
        given.SetValue(k, point(*each))
    fit = O.GeomAPI_Interpolate(given, periodic, 1e-9)
    fit.Perform()
    return fit.Curve()


def edge(curve):
    return O.BRepBuilderAPI_MakeEdge(curve).Edge()


def line(a, b):
    return O.BRepBuilderAPI_MakeEdge(point(*a), point(*b)).Edge()


def wire(*edges):
    made = O.BRepBuilderAPI_MakeWire()
    for each in edges:
        made.Add(each)
    return made.Wire()


def sheet(*edges):
    return O.BRepBuilderAPI_MakeFace(wire(*edges)).Face()


def circle(radius, place):
    return edge(O.gp_Circ(axis(*place), radius))


def vase():
    """A profile beside the z axis, one side a spline."""
    side = edge(spline((2, 0, 0), (2.5, 0, 1), (1.5, 0, 2), (2, 0, 3)))
    corners = [(2, 0, 3), (0.5, 0, 3), (0.5, 0, 0), (2, 0, 0)]
    return sheet(side, *(line(a, b) for a, b in zip(corners, corners[1:], strict=False)))


def turned(face, angle=2.0 * pi):
    return O.BRepPrimAPI_MakeRevol(face, O.gp_Ax1(point(0, 0, 0), O.gp_Dir(0, 0, 1)), angle).Shape()


def pushed(face, by=(0.3, 4.0, 0.1)):
    return O.BRepPrimAPI_MakePrism(face, O.gp_Vec(*map(float, by))).Shape()


def ellipse():
    return sheet(edge(O.gp_Elips(axis((3, 0, 0), (0, 1, 0)), 1.0, 0.5)))


def oval():
    """A periodic spline."""
    angles = [pi * k / 6.0 for k in range(12)]
    return spline(*((2.0 * cos(angle), 1.5 * sin(angle), 0) for angle in angles), periodic=True)


def bow(kind):
    """A sheet between an arc of a parabola or a hyperbola and its chord."""
    place = axis(*Z)
    if kind == "hyperbola":
        arc = O.GC_MakeArcOfHyperbola(O.gp_Hypr(place, 1.0, 0.7), -1.0, 1.0, True).Value()
    else:
        arc = O.GC_MakeArcOfParabola(O.gp_Parab(place, 1.0), -1.0, 1.0, True).Value()
    a, b = arc.StartPoint(), arc.EndPoint()
    return sheet(edge(arc), O.BRepBuilderAPI_MakeEdge(b, a).Edge())


def loft():
    made = O.BRepOffsetAPI_ThruSections(True, False)
    for z, radius in ((0, 1.0), (1, 1.5), (2, 0.7)):
        made.AddWire(wire(circle(radius, ((0.1 * z, 0, z), (0, 0, 1)))))
    made.Build()
    return made.Shape()


def pipe():
    path = spline((0, 0, 0), (1, 0, 2), (3, 1, 3), (5, 1, 2))
    start = path.DN(0, 1)
    return O.BRepOffsetAPI_MakePipe(
        wire(edge(path)), sheet(circle(0.3, ((0, 0, 0), (start.X(), start.Y(), start.Z()))))
    ).Shape()


def swollen():
    """Offset surfaces, and patches that round the edges between them."""
    made = O.BRepOffsetAPI_MakeOffsetShape()
    made.PerformByJoin(pushed(vase()), 0.1, 1e-6)
    return made.Shape()


def mirrored(shape):
    """In a left-handed placement of its surfaces."""
    turn = O.gp_Trsf()
    turn.SetMirror(axis((0, 0, 0), (1, 0.3, 0.2)))
    return O.BRepBuilderAPI_Transform(shape, turn, True).Shape()


def boss():
    """A cylinder on a plate, the edge between them rounded."""
    shape = joined(box(6.0, 6.0, 1.0, (-3, -3, -1)), cylinder())
    ring = [
        each
        for each in edges(shape)
        if O.GeomAPI_ProjectPointOnCurve(point(0, 2, 0), O.BRep_Tool.Curve_s(each, 0.0, 0.0)).NbPoints()
        and isinstance(O.BRep_Tool.Curve_s(each, 0.0, 0.0), O.Geom_Circle)
        and abs(O.BRep_Tool.Curve_s(each, 0.0, 0.0).Location().Z()) < 1e-9
    ]
    return filleted(shape, 0.4, ring[:1])


# Every kind of surface, and trims that cross seams, go round and reach poles.
MODELS = {
    "box": box,
    "cylinder": cylinder,
    "half cylinder": lambda: cylinder(angle=pi),
    "cone": cone,
    "frustum": lambda: cone(1.0, 2.0),
    "sphere": sphere,
    "slice of a sphere": lambda: sphere(-0.5, 1.1),
    "piece of a sphere": lambda: sphere(-0.5, 1.1, 4.0),
    "wedge of a sphere": lambda: sphere(0.3),
    "torus": torus,
    "sector of a torus": lambda: torus(2.0),
    "ring of a torus": lambda: torus(-0.5, 1.0),
    "piece of a torus": lambda: torus(-0.5, 1.0, 2.0),
    "rounded box": lambda: filleted(shape := box(4.0, 5.0, 6.0), 0.5, edges(shape)),
    "rounded cylinder": lambda: filleted(shape := cylinder(), 0.5, [edges(shape)[0]]),
    "boss": boss,
    "notched sphere": lambda: without(sphere(), cylinder(1.0, 10.0, ((0.5, 0.2, -5), (0, 0.2, 1)))),
    "drilled sphere": lambda: without(sphere(), drill()),
    "sphere drilled at its poles": lambda: without(sphere(), drill(at=(0.1, 0.2, -5), along=(0, 0, 1), length=10.0)),
    "drilled cylinder": lambda: without(cylinder(), drill(at=(-5, 0.2, 2.1), length=10.0)),
    "mirrored cylinder": lambda: mirrored(without(cylinder(), drill(at=(-5, 0.2, 2.1), length=10.0))),
    "drilled cone": lambda: without(cone(), drill(at=(-5, 0.1, 2.1), length=10.0)),
    "drilled torus": lambda: without(torus(), drill(at=(-9, 0.1, 0.1), length=10.0)),
    "cut torus": lambda: without(torus(), box(20.0, 20.0, 20.0, (-10, -10, 0.1))),
    "crossed cylinders": lambda: joined(cylinder(), drill(1.0, (-5, 0.2, 2.1), (1, 0.02, 0), 10.0)),
    "slanted cylinder": lambda: without(
        cylinder(), O.BRepPrimAPI_MakeBox(axis((-9, -9, 6), (0.3, 0.2, 1)), 30.0, 30.0, 30.0).Shape()
    ),
    "vase": lambda: turned(vase()),
    "part of a vase": lambda: turned(vase(), 2.2),
    "spindle": lambda: turned(
        sheet(edge(spline((0, 0, 0), (1.5, 0, 0.8), (1.2, 0, 2), (0, 0, 3))), line((0, 0, 3), (0, 0, 0)))
    ),
    "pushed vase": lambda: pushed(vase()),
    "pushed ellipse": lambda: pushed(ellipse(), (0.3, 4, 0.1)),
    "turned ellipse": lambda: turned(ellipse()),
    "part of a turned ellipse": lambda: turned(ellipse(), 1.0),
    "loft": loft,
    "pipe": pipe,
    "parabola": lambda: pushed(bow("parabola"), (0, 0, 2)),
    "hyperbola": lambda: pushed(bow("hyperbola"), (0, 0, 2)),
    "swollen vase": swollen,
}
