"""A bracket on a plate: two parts of CadQuery, the holes on one axis, the faces on each other, and placed back.

Needs CadQuery, in an environment of its own: pip install cadquery.
Prints where the bracket stands; writes cadquery_bracket.html for a browser.
"""

from __future__ import annotations

import cadquery as cq

import assembly as asm


def drawn() -> cq.Assembly:
    """Tags become names of faces: those that a hole is cut into, too."""
    plate = cq.Workplane().box(60, 40, 8).faces(">Z").tag("top").workplane().pushPoints([(15, 10)]).hole(9)
    bracket = cq.Workplane("XZ").polyline([(0, 0), (30, 0), (30, 5), (5, 5), (5, 30), (0, 30)]).close().extrude(-20)
    bracket = bracket.faces("<Z").tag("foot").workplane().pushPoints([(3, 0)]).hole(9)
    assembly = cq.Assembly(plate, name="plate", color=cq.Color("gray70"))
    loose = cq.Location(cq.Vector(70, -30, 50), cq.Vector(1, 2, 3), 70)
    return assembly.add(bracket, name="bracket", color=cq.Color(0.9, 0.6, 0.2), loc=loose)


def hole(assembly: cq.Assembly, bodies: dict[str, asm.Body], name: str) -> asm.Frame:
    """A frame on the axis of a part's hole, by CadQuery's selectors."""
    axis = assembly.objects[name].obj.faces("%CYLINDER").val()._geomAdaptor().Cylinder().Axis()
    at, along = axis.Location(), axis.Direction()
    up = 1.0 if along.Z() > 0 else -1.0
    return bodies[name].frame((at.X(), at.Y(), at.Z()), (up * along.X(), up * along.Y(), up * along.Z()))


def main() -> tuple[cq.Assembly, asm.Solution]:
    assembly = drawn()
    bodies = {body.name: body for body in asm.cad.from_cadquery(assembly, fixed=["plate"])}
    plate, bracket = bodies.values()
    scene = asm.Assembly([plate, bracket])
    holes = asm.Cylindrical(hole(assembly, bodies, "plate"), hole(assembly, bodies, "bracket"), angle=0.5)
    scene.constrain(holes, asm.Contact(plate.face("top"), bracket.face("foot"), edges=False))
    solution = scene.solve()
    asm.cad.place(assembly, solution)
    print(solution.status.value, assembly.objects["bracket"].loc.toTuple())
    asm.view.save_html("cadquery_bracket.html", scene, solution)
    return assembly, solution


if __name__ == "__main__":
    main()
