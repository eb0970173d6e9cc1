"""A shaft with a collar is put into two bearings, and turned and slid there as far as its collar lets it go.

The bearings are blocks on a base, with bores that are wider than the shaft by a play of 0.02 mm; between them the
collar can move by 2 mm. All parts start scattered. Joints say where the blocks stand, and that the shaft is in the
bores of both; a clearance keeps all bodies from crossing. At the ends of its travel the collar lies flush on a block.
Prints where the shaft is, and what is left on both sides of its collar; writes shaft_in_bearings.html, which plays it.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

RADIUS, LENGTH, PLAY = 10.0, 140.0, 0.02  # of the shaft [mm]
COLLAR, BROAD = 16.0, 36.0  # the collar: its radius, and how much of the shaft it takes
BLOCK, DEEP, APART = 50.0, 20.0, 60.0  # the blocks: across the shaft and along it; from middle to middle
FREE = 0.5 * (APART - DEEP - BROAD)  # what the collar has to go to either side
STEPS = 48


def shaft() -> list[asm.Face]:
    wall, *_ = asm.shapes.solid_cylinder(COLLAR, BROAD)
    rim, hole = (asm.shapes.solid_cylinder(radius, BROAD)[-1].outer for radius in (COLLAR, RADIUS))
    shoulders, ends = asm.shapes.extrusion(rim, BROAD, [hole])[-2:], asm.shapes.solid_cylinder(RADIUS, LENGTH)[-2:]
    wall.name = "collar"
    for side, shoulder, end in zip(("left", "right"), shoulders, ends, strict=True):
        shoulder.name, end.name = f"{side} shoulder", f"{side} end"
    journal, off = asm.shapes.cylinder(RADIUS, 0.5 * (LENGTH - BROAD)), 0.25 * (LENGTH + BROAD)
    journals = [asm.Face(journal.transformed(translation=(0.0, 0.0, side * off))) for side in (-1.0, 1.0)]
    return [wall, *shoulders, *journals, *ends]


def shaft_in_bearings() -> tuple[asm.Assembly, asm.Cylindrical]:
    block = asm.shapes.plate(BLOCK, BLOCK, DEEP, [(0.0, 0.0, RADIUS + PLAY)])
    base = asm.Body("base", asm.shapes.box(APART + DEEP, BLOCK, 10.0), (0.0, 0.0, -0.5 * BLOCK - 5.0), fixed=True)
    left = asm.Body("left", block, (-90.0, 40.0, 30.0), (0.9, 0.3, 0.3, 0.1))
    right = asm.Body("right", block, (20.0, -80.0, 60.0), (0.8, -0.2, 0.4, 0.4))
    turned = asm.Body("shaft", shaft(), (60.0, 90.0, 120.0), (0.7, 0.1, 0.5, 0.5), color=(0.62, 0.64, 0.68))
    along, up = (1.0, 0.0, 0.0), 0.5 * BLOCK + 5.0
    axis = asm.Cylindrical(base.frame((0.0, 0.0, up), z=along), turned.frame(), "axis", angle=0.0, slide=0.0)
    scene = asm.Assembly([base, left, right, turned])
    scene.constrain(
        asm.Fixed(base.frame((-0.5 * APART, 0.0, up), z=along), left.frame(), "left stands"),
        asm.Fixed(base.frame((0.5 * APART, 0.0, up), z=along), right.frame(), "right stands"),
        axis,
        asm.Cylindrical(left.frame(), turned.frame(), "left bore"),
        asm.Cylindrical(right.frame(), turned.frame(), "right bore"),
        asm.Clearance(),
    )
    return scene, axis


def main() -> list[asm.Solution]:
    scene, axis = shaft_in_bearings()
    solutions = [scene.solve()]
    print(f"{solutions[0].status.name}: put together first: {solutions[0].put_together}")
    for turn in np.linspace(0.0, 2.0 * np.pi, STEPS + 1)[1:]:
        axis.angle, axis.slide = 2.0 * turn, FREE * np.sin(turn)
        solutions.append(scene.solve(solutions[-1]))
    print("shaft [deg]   at [mm]   left of the collar   right of it")
    for solution in solutions[::4]:
        at, angle = solution.pose("shaft").position[0] + 0.0, np.degrees(solution.values["axis.angle"]) + 0.0
        proved = "proved" if solution.proved else "not proved"
        print(f"{angle:11.1f}{at:10.4f}{FREE + at:21.6f}{FREE - at:14.6f}   {solution.status.name}, {proved}")
    poses = np.array([solution.q for solution in solutions])
    said = [f"shaft {np.degrees(solution.values['axis.angle']):.0f} deg" for solution in solutions]
    direction = (0.25, -1.0, 0.6)
    asm.view.animate(scene, poses, "shaft_in_bearings.html", seconds=6.0, direction=direction, captions=said)
    return solutions


if __name__ == "__main__":
    main()
