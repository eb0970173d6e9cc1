"""A spatial four-bar in a hand, which holds the middle of its upper link in three ways.

A universal joint, a ball and two hinges leave one degree of freedom. The hand draws a point of the link (point grasp)
or a frame on it (rigid grasp), or it is a ring around the link that is drawn to its own pose while the two touch
(surface grasp). Prints the crank's angle, how far what is held stays from the hand, and the iterations of each; writes
the surface grasp as four_bar.html into the working directory: open it in any browser and turn it around.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

HAND = (40.0, -40.0, 80.0)  # [mm]
MIDDLE = (75.0, 0.0, 0.0)
ALONG_X = (0.7071, 0.0, 0.7071, 0.0)  # the quaternion that turns a ring's axis along x
UP, RIGHT = (asm.shapes.Path(direction=way) for way in ((0, 0, 1), (1, 0, 0)))


def grasped(kind: str) -> tuple[asm.Assembly, asm.Body, tuple[float, float, float]]:
    ground = asm.Body("ground", asm.shapes.box(200, 80, 10), fixed=True)
    crank = asm.Body("crank", asm.shapes.pipe(UP.line(60), 5), position=(-70, 0, 15))
    link = asm.Body("link", asm.shapes.pipe(RIGHT.line(150), 4), position=(-70, 0, 75))
    rocker = asm.Body("rocker", asm.shapes.pipe(UP.line(90), 5), position=(70, 0, 15))
    scene = asm.Assembly([ground, crank, link, rocker])
    scene.constrain(
        asm.Revolute(ground.frame(at=(-70, 0, 15), z=(0, 1, 0)), crank.frame(z=(0, 1, 0)), "crank hinge"),
        asm.Universal(crank.frame(at=(0, 0, 60), z=(0, 1, 0)), link.frame(z=(0, 0, 1)), "cross"),
        asm.Spherical(link.point(150, 0, 0), rocker.point(0, 0, 90), "ball"),
        asm.Revolute(ground.frame(at=(70, 0, 15), z=(1, 1, 0)), rocker.frame(z=(1, 1, 0)), "rocker hinge"),
    )
    if kind == "point":
        scene.minimize(asm.PointDistance(link.point(*MIDDLE), HAND))
    elif kind == "rigid":
        scene.minimize(asm.FrameDistance(link.frame(at=MIDDLE), asm.Pose(HAND), length=75))
    else:
        ring = scene.add(asm.Body("hand", asm.shapes.torus(14, 4), position=(0, -4, 75), quaternion=ALONG_X))
        scene.constrain(asm.Contact(link, ring, "grip"))
        scene.minimize(asm.FrameDistance(ring, asm.Pose(HAND, ALONG_X), length=20))
        return scene, ring, (0.0, 0.0, 0.0)
    return scene, link, MIDDLE


def main() -> dict[str, asm.Solution]:
    print("grasp     crank [deg]   apart [mm]   iterations")
    solutions = {}
    for kind in ("point", "rigid", "surface"):
        scene, body, held = grasped(kind)
        solution = solutions[kind] = scene.solve()
        angle, apart = solution.values["crank hinge.angle"], np.linalg.norm(solution.pose(body).apply(held) - HAND)
        print(f"{kind:<8}{np.degrees(angle):13.6f}{apart:13.6f}{solution.iterations:13d}   {solution.status.name}")
    asm.view.save_html("four_bar.html", scene, solution)
    return solutions


if __name__ == "__main__":
    main()
