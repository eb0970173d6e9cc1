"""Two plates, two bolts and two nuts lie about, and are bolted together.

Joints say what belongs where: the plates are flush, a bolt stands in a hole of both with its head on the upper plate, a
nut is on its bolt, below the lower plate. A clearance keeps all bodies from crossing. The bolts have half a millimeter
of play in their holes, the nuts a tenth on their bolts; heads, plates and nuts lie flush on each other. Where the parts
lie now, the bolts are on the wrong side of both plates, and their heads do not fit through the holes. So the parts are
put together without the clearance first, and then it is proven that nothing crosses. Prints where they end, beside
where they are known to belong; writes bolted_plates.html, to be opened in any browser.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

THICK, HOLE = 10.0, 4.5  # of the plates: their thickness, and the radius of their holes [mm]
SHANK, LENGTH, BORE = 4.0, 30.0, 4.1  # of the bolts: radius and length; the radius of the bore of a nut
ACROSS, HIGH = 13.0, 6.0  # heads and nuts are hexagons
SIDES = {"left": -25.0, "right": 25.0}  # where the holes are, along x
# Where parts belong.
HEIGHTS = {"lower": 0.0, "upper": THICK, "bolt": 1.5 * THICK + 0.5 * HIGH, "nut": -0.5 * (THICK + HIGH)}


def hexagon() -> list[asm.NurbsCurve]:
    corners = ACROSS / np.sqrt(3.0) * np.exp(1j * np.pi / 3.0 * np.arange(7))
    ends = zip(corners[:-1], corners[1:], strict=True)
    return [asm.NurbsCurve([(a.real, a.imag), (b.real, b.imag)], [0, 0, *2 * [abs(b - a)]], 1) for a, b in ends]


def nut(bore: float) -> tuple[asm.Face, ...]:
    """A hexagon with a bore; its last two faces are the bottom and the top."""
    return asm.shapes.extrusion(hexagon(), HIGH, [asm.shapes.solid_cylinder(bore, HIGH)[-1].outer])


def bolt() -> list[asm.Face]:
    """A head about the origin, and a shank below it."""
    *head, _, top = asm.shapes.extrusion(hexagon(), HIGH)
    seat = nut(SHANK)[-2]
    shank = asm.shapes.cylinder(SHANK, LENGTH).transformed(translation=(0.0, 0.0, -0.5 * (HIGH + LENGTH)))
    end = asm.shapes.solid_cylinder(SHANK, HIGH + 2.0 * LENGTH)[-2]
    seat.name, end.name = "seat", "end"
    return [*head, top, seat, asm.Face(shank, name="shank"), end]


def parts() -> list[asm.Body]:
    """What there is, and where it happens to lie."""
    plate = asm.shapes.plate(80.0, 40.0, THICK, [(x, 0.0, HOLE) for x in SIDES.values()])
    steel = (0.62, 0.64, 0.68)
    return [
        asm.Body("lower", plate, fixed=True),
        asm.Body("upper", plate, (12.0, -7.0, 45.0), (0.97, 0.10, -0.10, 0.18)),
        asm.Body("left bolt", bolt(), (-40.0, 10.0, -50.0), (0.95, 0.20, 0.10, 0.20), color=steel),
        asm.Body("left nut", nut(BORE), (-50.0, 5.0, 70.0), (0.90, 0.30, 0.20, 0.25), color=steel),
        asm.Body("right bolt", bolt(), (30.0, -20.0, -60.0), (0.95, -0.10, 0.20, 0.20), color=steel),
        asm.Body("right nut", nut(BORE), (45.0, 15.0, 60.0), (0.90, -0.30, 0.10, 0.30), color=steel),
    ]


def bolted() -> asm.Assembly:
    """What belongs where, and that nothing crosses."""
    lower, upper, *fasteners = bodies = parts()
    top, bottom = (0.0, 0.0, 0.5 * THICK), (0.0, 0.0, -0.5 * THICK)
    scene = asm.Assembly(bodies)
    scene.constrain(asm.Planar(lower.frame(top), upper.frame(bottom), "flush"))
    for (side, x), screw, counter in zip(SIDES.items(), fasteners[::2], fasteners[1::2], strict=True):
        scene.constrain(
            asm.Cylindrical(lower.frame((x, 0.0, 0.0)), screw.frame(), f"{side} hole of the lower plate"),
            asm.Cylindrical(upper.frame((x, 0.0, 0.0)), screw.frame(), f"{side} hole of the upper plate"),
            asm.Planar(upper.frame(top), screw.frame((0.0, 0.0, -0.5 * HIGH)), f"{side} head"),
            asm.Cylindrical(screw.frame(), counter.frame(), f"{side} thread"),
            asm.Planar(lower.frame(bottom), counter.frame((0.0, 0.0, 0.5 * HIGH)), f"{side} nut"),
        )
    scene.constrain(asm.Clearance())
    return scene


def main() -> tuple[asm.Assembly, asm.Solution]:
    scene = bolted()
    solution = scene.solve()
    print(f"{solution.status.name}: put together first: {solution.put_together}, proved: {solution.proved}")
    print("part             x [mm]     y [mm]     z [mm]    belongs at x, z")
    for body in scene.bodies:
        side, _, kind = body.name.rpartition(" ")
        x, y, z = solution.pose(body).position + 0.0
        print(f"{body.name:12}{x:11.6f}{y:11.6f}{z:11.6f}{SIDES.get(side, 0.0):12.1f}{HEIGHTS[kind]:8.1f}")
    asm.view.save_html("bolted_plates.html", scene, solution)
    return scene, solution


if __name__ == "__main__":
    main()
