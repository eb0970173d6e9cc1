"""An egg is led over a curved plate with a hole, and its contact goes around the hole, not across it.

The egg touches the plate all the time, and a target frame draws it straight across the hole. The contact may be
anywhere on the two surfaces except in the hole: it stops at the rim, slides along it and leaves it on the other side.
Prints where the contact is, and writes avoid_the_hole.html, which plays the motion: open it in any browser.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

CENTER, RADIUS = (4.0, 9.0), 18.0  # of the hole, seen from above [mm]
HEIGHTS = 3.0 * np.array([[2, 1, 0, 1, 3], [0, -1, 0, 1, 1], [-1, 0, 3, 1, 0], [0, 2, 2, 0, -1], [2, 1, 0, 0, 2]])


def curved_plate() -> asm.Face:
    """A bicubic surface over 100 by 80 mm, S(u, v) = (u, v, height), and a round hole in it."""
    knots = [side * np.array([-1, -1, -1, -1, 0, 1, 1, 1, 1]) for side in (50.0, 40.0)]
    along = [[np.mean(row[k + 1 : k + 4]) for k in range(5)] for row in knots]  # with these, x = u and y = v
    net = np.dstack([*np.meshgrid(*along, indexing="ij"), HEIGHTS])
    around = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]])
    circle = asm.NurbsCurve(CENTER + RADIUS * around, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], 2, [1, 0.5**0.5] * 4 + [1])
    return asm.Face(asm.NurbsSurface(net, knots, (3, 3)), holes=[circle], name="top")


def egg_on_plate() -> tuple[asm.Assembly, asm.FrameDistance]:
    plate = asm.Body("plate", curved_plate(), fixed=True)
    egg = asm.Body("egg", asm.shapes.ellipsoid(9.0, 6.0, 5.0), position=(-36.0, 0.0, 8.0))
    touch = asm.Contact(plate, egg, "touch")
    hand = asm.FrameDistance(egg.frame(), asm.Pose((-36.0, 0.0, 5.0)), length=20.0)
    scene = asm.Assembly([plate, egg])
    scene.constrain(touch, asm.TrimContact(touch, plate.face().face.holes[0], keep="outside", name="around the hole"))
    scene.minimize(hand)
    return scene, hand


def main() -> list[asm.Solution]:
    scene, hand = egg_on_plate()
    solutions = [scene.solve()]
    for x in np.linspace(-36.0, 40.0, 77)[1:]:
        hand.target = asm.Pose((x, 0.0, 5.0))
        solutions.append(scene.solve(solutions[-1]))
    print("hand x    contact u, v         from the hole's center   gap")
    for x, solution in zip(np.linspace(-36.0, 40.0, 77)[::4], solutions[::4], strict=True):
        pair = solution.contacts["touch"]
        u, v = pair.parameters[:2]
        away = np.hypot(u - CENTER[0], v - CENTER[1])
        print(f"{x:6.1f}{u:12.6f}{v:12.6f}{away:16.9f}{pair.gap:16.1e}   {solution.status.name}")
    asm.view.animate(scene, solutions, "avoid_the_hole.html", seconds=10.0, direction=(0.3, -1.0, 0.8))
    return solutions


if __name__ == "__main__":
    main()
