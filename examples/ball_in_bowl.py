"""A ball in a bowl follows a hand that draws it over the bottom, up to the rim, out over it and back.

The bowl is a curved surface cut off by a round rim: a face and an edge. Nothing says where the ball touches, or whether
it does: a clearance keeps the two from crossing, and the hand, a spring, presses the ball against whatever is in the
way. The contact moves from the face to the edge and around it as the hand moves. Prints where the ball was and how well
it held, and writes ball_in_bowl.html, which plays the motion: open it in any browser.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

STEEPNESS, RIM, RADIUS = 0.03, 20.0, 5.0  # z = steepness (x^2 + y^2) up to the rim; of the ball [mm]
# Where the hand goes, in mm, and when, in seconds.
PLACES = np.array([
    (2, 1, 8), (2, 1, 3), (-9, 3, 4), (6, -11, 5), (14, 2, 12), (20, 4, 17), (23, 4, 13), (24, 8, 19),
    (8, 8, 12), (0, 0, 8),
])  # fmt: skip
TIMES = np.array([0.0, 0.5, 1.1, 1.7, 2.3, 2.8, 3.4, 4.0, 4.7, 5.2])


def bowl() -> asm.Face:
    """S(u, v) = (u, v, steepness (u^2 + v^2)), its outward side up, and the rim."""
    half = 1.2 * RIM
    x, y = np.meshgrid(*2 * [np.array([-half, 0.0, half])], indexing="ij")
    square = half**2 * np.array([1.0, -1.0, 1.0])  # Bezier coefficients of x^2 from -half to half
    z = STEEPNESS * (square[:, None] + square[None, :])
    knots = np.array([-half] * 3 + [half] * 3)
    around = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1], [1, 0]])
    rim = asm.NurbsCurve(RIM * around, [0, 0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 4], 2, [1, 0.5**0.5] * 4 + [1])
    return asm.Face(asm.NurbsSurface(np.dstack([x, y, z]), (knots, knots), (2, 2)), rim, name="bowl")


def ball_in_bowl() -> asm.Assembly:
    dish = asm.Body("bowl", bowl(), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(RADIUS), PLACES[0], (0.8, 0.36, 0.48, 0.0))
    scene = asm.Assembly([dish, ball])
    scene.constrain(asm.Clearance())
    return scene


def main() -> asm.TrackLog:
    scene = ball_in_bowl()
    trace = asm.Trace.through(PLACES, TIMES)
    log = scene.tracker(follow=scene.body("ball").point(0, 0, 0)).run(trace, stride=10)
    print(log)
    print("where the hand is           where the ball's center is")
    for k in range(0, len(log.q), 40):
        hand, center = trace.targets[10 * k], log.q[k, 1, :3]
        print("".join(f"{x:8.2f}" for x in (*hand, *center)))
    asm.view.replay(scene, log, "ball_in_bowl.html", hand=trace, direction=(0.4, -1.0, 0.6))
    return log


if __name__ == "__main__":
    main()
