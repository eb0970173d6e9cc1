"""A bracket on a plate: two parts of CadQuery, the holes on one axis, the faces on each other, and placed back.

Needs CadQuery, in an environment of its own: pip install cadquery.
Prints where the bracket stands; writes cadquery_bracket.html for a browser.
"""

from __future__ import annotations

try:
    import cadquery as cq
except ImportError:
    raise SystemExit("CadQuery is not installed; pip install cadquery, in an environment of its own") from None

import assembly as asm


def drawn() -> cq.Assembly:
    """Tags become names of faces: those that a hole is cut into, too."""
    plate = cq.Workplane().box(60, 40, 8).faces(">Z").tag("top").workplane().pushPoints([(15, 10)]).hole(9)
    bracket = cq.Workplane("XZ").polyline([(0, 0), (30, 0), (30, 5), (5, 5), (5, 30), (0, 30)]).close().extrude(-20)
    bracket = bracket.faces("<Z").tag("foot").workplane().pushPoints([(3, 0)]).hole(9)
    assembly = cq.Assembly(plate, name="plate", color=cq.Color("gray70"))
    loose = cq.Location(cq.Vector(70, -30, 50), cq.Vector(1, 2, 3), 70)
    return assembly.add(bracket, name="bracket", color=cq.Color(0.9, 0.6, 0.2), loc=loose)


def main() -> tuple[cq.Assembly, asm.Solution]:
    assembly = drawn()
    bodies = {body.name: body for body in asm.cad.from_cadquery(assembly, fixed=["plate"])}
    plate, bracket = bodies.values()
    scene = asm.Assembly([plate, bracket])
    holes = asm.Coaxial(plate.faces("%CYLINDER"), bracket.faces("%CYLINDER"), angle=0.5)
    scene.constrain(holes, asm.Flush(plate.face("top"), bracket.face("foot")))
    solution = scene.solve()
    asm.cad.place(assembly, solution)
    print(solution.status.value, assembly.objects["bracket"].loc.toTuple())
    asm.view.save_html("cadquery_bracket.html", scene, solution)
    return assembly, solution


if __name__ == "__main__":
    main()
