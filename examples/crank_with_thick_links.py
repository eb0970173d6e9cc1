"""A crank turns once and swings a rocker, in links that are 6 mm thick and lie side by side on pins.

The links are plates of 20 by 6 mm with two bores each, the pins are cylinders with a play of 0.05 mm in these. Crank
and rocker lie on the ground, the coupler lies on both of them, so that it goes over the pins in the ground, flush with
their ends. Joints connect them, and a clearance keeps all pairs of bodies from crossing. None of their many contacts
pushes while all slide along each other: a step is solved by its joints and then proven to be clear. Prints the rocker's
angle beside that of the closed form; writes crank_with_thick_links.html, which plays the turn.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

WIDE, THICK, PIN, PLAY = 20.0, 6.0, 5.0, 0.05  # the pin's radius, and the bores are wider by the play [mm]
LENGTHS = {"ground": 100.0, "crank": 30.0, "coupler": 90.0, "rocker": 60.0}  # from bore to bore
STEPS = 72


def link(name: str) -> asm.Body:
    length = LENGTHS[name]
    bores = [(end * length / 2, 0.0, PIN + PLAY) for end in (-1, 1)]
    return asm.Body(name, asm.shapes.plate(length + WIDE, WIDE, THICK, bores), fixed=name == "ground")


def bore(link: asm.Body, end: int, side: int = 1) -> asm.Frame:
    """The middle of a bore, on top of a link or below it."""
    return link.frame((end * LENGTHS[link.name] / 2, 0.0, side * THICK / 2))


def crank() -> tuple[asm.Assembly, asm.Revolute]:
    ground, crank, coupler, rocker = links = [link(name) for name in LENGTHS]
    steel = (0.62, 0.64, 0.68)
    pins = [asm.Body(f"pin {k}", asm.shapes.solid_cylinder(PIN, 2 * THICK), color=steel) for k in "ABCD"]
    # Where the rocker swings: below the ground's line it would hang together as well.
    coupler.pose, rocker.pose = asm.Pose((0.0, 60.0, 12.0)), asm.Pose.from_axis_angle((0, 0, 1), 1.6, (50.0, 30.0, 6.0))
    drive = asm.Revolute(bore(ground, -1), bore(crank, -1, -1), "drive", angle=0.0)
    scene = asm.Assembly([*links, *pins])
    scene.constrain(
        drive,
        asm.Revolute(bore(crank, 1), bore(coupler, -1, -1), "elbow"),
        asm.Revolute(bore(rocker, 1), bore(coupler, 1, -1), "wrist"),
        asm.Revolute(bore(ground, 1), bore(rocker, -1, -1), "swing"),
    )
    # Where it is held, each pin is in the middle of its bore.
    held = bore(ground, -1), bore(crank, 1), bore(rocker, 1), bore(ground, 1)
    scene.constrain(*(asm.Fixed(place, pin) for place, pin in zip(held, pins, strict=True)))
    scene.constrain(asm.Clearance())
    return scene, drive


def swing(angle: float) -> float:
    """The rocker's angle [rad], by the place where circles about the ends of crank and ground meet."""
    ground, crank, coupler, rocker = LENGTHS.values()
    way = ground - crank * np.exp(1j * angle)
    corner = np.arccos((abs(way) ** 2 + rocker**2 - coupler**2) / (2 * abs(way) * rocker))
    return float(np.angle(-way) - corner) % (2.0 * np.pi)


def main() -> list[asm.Solution]:
    scene, drive = crank()
    solutions = [scene.solve()]
    for angle in np.linspace(0.0, 2.0 * np.pi, STEPS + 1)[1:]:
        drive.angle = angle
        solutions.append(scene.solve(solutions[-1]))
    good = sum(solution.success and solution.proved for solution in solutions[1:])
    print(f"{good} of {STEPS} steps are solved, and proven to be clear")
    print("crank [deg]   rocker [deg]   by circles")
    for solution in solutions[::6]:
        at, rocker = solution.values["drive.angle"], solution.values["swing.angle"]
        print(f"{np.degrees(at):11.1f}{np.degrees(rocker):15.6f}{np.degrees(swing(at)):13.6f}")
    # Poses alone: with solutions their contacts, some three hundred, are drawn as well.
    poses = np.array([solution.q for solution in solutions])
    said = [f"crank {np.degrees(solution.values['drive.angle']):.0f} deg" for solution in solutions]
    direction = (0.2, -0.8, 1.0)
    asm.view.animate(scene, poses, "crank_with_thick_links.html", seconds=6.0, direction=direction, captions=said)
    return solutions


if __name__ == "__main__":
    main()
