"""Parts come from a STEP file and lie about anywhere; holes and faces put them together, and a STEP file is written.

A corner bracket is bolted to a plate. Holes, bolts and nuts share axes and faces lie flush: faces are selected by what
they are, or by the names that the file gives them.
The parts are drawn here, so that it takes no other file, but OCCT: pip install "assembly-solver[step]".
Prints what is left to move and where the parts are; writes step_assembly.step, and step_assembly.html for a browser.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

HOLES = np.array([[17.0, -13.0], [-18.0, 12.0]])  # in the plate [mm]
CORNER = np.array([-25.0, -20.0])  # of the bracket, on the plate


def polygon(*corners: complex) -> list[asm.NurbsCurve]:
    sides = zip(corners, np.roll(corners, -1), strict=True)
    return [asm.NurbsCurve([(a.real, a.imag), (b.real, b.imag)], [0, 0, *2 * [abs(b - a)]], 1) for a, b in sides]


def circle(x: float, y: float, radius: float) -> asm.NurbsCurve:
    around = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]])
    return asm.NurbsCurve((x, y) + radius * around, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], 2, [1, 0.5**0.5] * 4 + [1])


def drawn() -> list[asm.Body]:
    plate = asm.shapes.plate(100, 60, 8, [(*hole, 4.5) for hole in HOLES])
    outline = polygon(0, 50, 50 + 14j, 14 + 14j, 14 + 40j, 40j)
    bracket = asm.shapes.extrusion(outline, 6, [circle(*hole - CORNER, 4.5) for hole in HOLES])
    hexagon, bore = polygon(*7.5 * np.exp(1j * np.pi / 3 * np.arange(6))), circle(0, 0, 4)
    nut, seat = asm.shapes.extrusion(hexagon, 6, [bore]), asm.shapes.extrusion(hexagon, 5, [bore])[-2]
    *head, _, top = asm.shapes.extrusion(hexagon, 5)
    shank = asm.Face(asm.shapes.cylinder(4, 25).transformed(translation=(0, 0, -15)), name="shank")
    end = asm.shapes.solid_cylinder(4, 2 * 27.5)[-2]
    seat.name, end.name = "under head", "end"
    bolt = [*head, top, seat, shank, end]
    shapes = {"plate": plate, "bracket": bracket, "bolt": bolt, "bolt 2": bolt, "nut": nut, "nut 2": nut}
    steel = {name: (0.62, 0.64, 0.68) for name in shapes if name[:3] in ("bol", "nut")}
    return [asm.Body(name, shape, color=steel.get(name)) for name, shape in shapes.items()]


def put_together(plate: asm.Body, bracket: asm.Body, *fasteners: asm.Body) -> asm.Assembly:
    ground = asm.Body("ground", fixed=True)
    scene = asm.Assembly([ground, plate, bracket, *fasteners])
    lower, upper = plate.faces.cylinders(radius=4.5, hole=True), bracket.faces.cylinders(radius=4.5, hole=True)
    scene.constrain(asm.Fixed(ground, plate), asm.Flush(plate.faces(">Z"), bracket.faces("<Z")))
    for k, hole in enumerate(HOLES):
        below, above, bolt, nut = lower.near((*hole, 0)), upper.near((*hole - CORNER, 0)), *fasteners[k::2]
        scene.constrain(asm.Coaxial(below, above, f"holes {k + 1}"))
        scene.constrain(asm.Coaxial(above, bolt.face("shank")), asm.Coaxial(below, nut.faces.cylinders(hole=True)))
        scene.constrain(asm.Flush(bracket.faces(">Z"), bolt.face("under head")))
        scene.constrain(asm.Flush(plate.faces("<Z"), nut.faces(">Z")))
    return scene


def main() -> tuple[asm.Assembly, asm.Solution]:
    asm.write_step("step_assembly.step", drawn())
    bodies, random = asm.read_step("step_assembly.step"), np.random.default_rng(5)
    for body in bodies:
        body.pose = asm.Pose.from_axis_angle(random.normal(size=3), random.uniform(0, 3), random.uniform(-150, 150, 3))
    scene = put_together(*bodies)
    solution = scene.solve()
    print(f"{solution.status.name}; {scene.mobility(solution).dof} degrees of freedom: bolts and nuts can turn")
    for body in bodies:
        body.pose = solution.pose(body)
        print(f"{body.name:<9}", *(f"{x:12.6f}" for x in body.pose.position))
    asm.write_step("step_assembly.step", bodies)
    asm.view.save_html("step_assembly.html", scene, solution)
    return scene, solution


if __name__ == "__main__":
    try:
        main()
    except ImportError as missing:
        raise SystemExit(str(missing)) from None
