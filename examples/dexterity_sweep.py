"""A five-bar linkage on a turntable: how well its inputs move the tip, all around, and the pose where they do best.

The turntable and one crank are driven through a turn. At each pose the velocities of the tip, for rates of the three
inputs of norm one, fill an ellipsoid; the product of its half axes is the manipulability. Then the crank is let go
between the neighbors of the sweep's best pose, and the manipulability is maximized.
Prints both, and writes dexterity_sweep.html, which plays the sweep with its ellipsoids: open it in any browser.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

BACK = (0.0, -1.0, 0.0)  # the axis of the cranks; about it, x turns toward z


def five_bar() -> tuple[asm.Assembly, list[asm.Revolute], asm.Dexterity]:
    ground, table = asm.Body("ground", fixed=True), asm.Body("table")
    left, right = asm.Body("left crank"), asm.Body("right crank")
    rod, other = (asm.Body(f"{side} rod", quaternion=(0.866, 0.0, -0.5, 0.0)) for side in ("left", "right"))
    inputs = [
        asm.Revolute(ground.frame(), table.frame(), "turntable", angle=0.0),
        asm.Revolute(table.frame(at=(60, 0, 40), z=BACK), left.frame(z=BACK), "crank", angle=0.0),
        asm.Revolute(table.frame(at=(100, 0, 40), z=BACK), right.frame(z=BACK), "right crank", angle=1.2),
    ]
    linkage = asm.Assembly([ground, table, left, right, rod, other])
    linkage.constrain(
        *inputs,
        asm.Revolute(left.frame(at=(30, 0, 0), z=BACK), rod.frame(z=BACK), "elbow"),
        asm.Universal(right.frame(at=(50, 0, 0), z=BACK), other.frame(), "right elbow"),
        asm.Spherical(rod.point(90, 0, 0), other.point(70, 0, 0), "wrist"),
    )
    return linkage, inputs, asm.Dexterity(rod.point(90, 0, 0), inputs, "manipulability")


def main() -> tuple[list[asm.Solution], asm.Solution]:
    linkage, (table, crank, right), dexterity = five_bar()
    tip = dexterity.tip_task.tip
    angles, sweep = np.radians(np.arange(0, 361, 3)), [linkage.solve()]
    for angle in angles[1:]:
        table.angle = crank.angle = angle
        sweep.append(linkage.solve(sweep[-1]))
    measures = [asm.dexterity_value(linkage, dexterity, pose) for pose in sweep]
    shapes = [asm.dexterity_ellipsoid(linkage, tip, [table, crank, right], pose, scale=0.3) for pose in sweep]
    frames = [(*shapes[:-1:6], asm.Ellipsoid(e.center, e.axes, e.lengths, color=(0.95, 0.52, 0.12))) for e in shapes]
    asm.view.animate(linkage, sweep, "dexterity_sweep.html", seconds=8.0, ellipsoids=frames, direction=(0.5, -1, 0.6))
    for angle, measure in zip(angles[::10], measures[::10], strict=True):
        print(f"crank {np.degrees(angle):10.5f} deg   manipulability {measure:12.4f} mm^3")
    k = int(np.argmax(measures))
    table.angle, crank.angle, crank.limits = angles[k], None, (angles[k - 1], angles[k + 1])
    linkage.maximize(dexterity)
    best = linkage.solve(sweep[k].q)
    print(f"best  {np.degrees(best.values['crank.angle']):10.5f} deg   manipulability {-best.objective:12.4f} mm^3")
    return sweep, best


if __name__ == "__main__":
    main()
