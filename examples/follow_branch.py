"""A rocker's angle, followed around the whole loop of a four-bar, though it cannot turn around.

A crank that turns around drives a rocker that swings. The two ends of the rocker's swing are dead centers: there the
branch of solutions turns back in the rocker's angle, and the crank goes on. Prints the branch's events beside the
closed form, and how well the loop closes; writes follow_branch.html, where the mechanism runs along its branch, and
follow_branch.png if matplotlib is installed. A post beside the coupler then blocks the crank on both sides: the events
tell where.
"""

from __future__ import annotations

from importlib.util import find_spec
from math import acos, cos, pi, sin

import assembly as asm

CRANK, COUPLER, ROCKER, GROUND = 1.0, 3.0, 2.5, 3.2


def dead_center(reach: float) -> float:
    """The rocker's angle where crank and coupler lie along each other."""
    return pi - acos((GROUND**2 + ROCKER**2 - reach**2) / (2.0 * GROUND * ROCKER))


def turned(angle: float) -> tuple[float, float, float, float]:
    """The quaternion of a turn about z."""
    return cos(0.5 * angle), 0.0, 0.0, sin(0.5 * angle)


def beside_a_post() -> asm.Branch:
    """The crank's angle of the same four-bar, followed to where its coupler meets a post."""
    ground = asm.Body("ground", fixed=True)
    post = asm.Body("post", asm.shapes.solid_cylinder(0.15, 1.0), position=(1.35, 1.9, 0.0), fixed=True)
    crank, rocker = asm.Body("crank"), asm.Body("rocker", position=(GROUND, 0, 0), quaternion=turned(1.6))
    coupler = asm.Body("coupler", asm.shapes.box(COUPLER, 0.2, 0.2), position=(1.9, 1.5, 0), quaternion=turned(0.7))
    half = 0.5 * COUPLER
    drive = asm.Revolute(ground, crank, "crank", angle=0.7)
    scene = asm.Assembly([ground, post, crank, coupler, rocker])
    scene.constrain(
        drive,
        asm.Revolute(ground.frame(at=(GROUND, 0, 0)), rocker, "rocker"),
        asm.Revolute(crank.frame(at=(CRANK, 0, 0)), coupler.frame(at=(-half, 0, 0)), "pin"),
        asm.Revolute(coupler.frame(at=(half, 0, 0)), rocker.frame(at=(ROCKER, 0, 0)), "wrist"),
        asm.Clearance(),
    )
    return asm.follow(scene, asm.Parameter(drive, "angle"), -pi, pi, swept=True)


def main() -> tuple[asm.Branch, asm.Branch]:
    ground = asm.Body("ground", fixed=True)
    crank, coupler, rocker = (asm.Body(name) for name in ("crank", "coupler", "rocker"))
    drive = asm.Revolute(ground, crank, "crank")
    pivot = asm.Revolute(ground.frame(at=(GROUND, 0, 0)), rocker, "rocker", angle=2.0)
    pins = [
        asm.Revolute(crank.frame(at=(CRANK, 0, 0)), coupler, "pin"),
        asm.Revolute(coupler.frame(at=(COUPLER, 0, 0)), rocker.frame(at=(ROCKER, 0, 0)), "wrist"),
    ]
    scene = asm.Assembly([ground, crank, coupler, rocker])
    scene.constrain(drive, pivot, *pins)

    angle = asm.Parameter(pivot, "angle", name="rocker")
    branch = asm.follow(scene, angle, 0.0, pi, of=asm.Measure(drive))
    print(branch)
    for reach in (COUPLER + CRANK, COUPLER - CRANK):
        print(f"dead center by cosines: {dead_center(reach):.12g}")
    asm.view.animate(scene, branch.poses, "follow_branch.html", seconds=8.0)
    if find_spec("matplotlib"):
        branch.plot().savefig("follow_branch.png", dpi=100)
    blocked = beside_a_post()
    print(blocked)
    return branch, blocked


if __name__ == "__main__":
    main()
