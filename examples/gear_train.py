"""A compound gear train with a rack: ten turns of the crank are one turn of the pinion.

12 teeth drive 48, on whose shaft 16 drive 40, on whose shaft 14 drive the rack; at the end the rack is pushed back.
Prints angles, which continue past whole turns, and writes gear_train.html, which plays the motion: open it in any
browser.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

TURN = 2.0 * np.pi


def toothed(teeth: int, floor: float, turned: float = 0.0, straight: bool = False) -> asm.NurbsSurface:
    """A wheel of as many mm radius as teeth, or a bar; the first tooth lies along x, or is moved on by so many."""
    k = np.arange(4 * teeth + 1)
    along = k // 4 + turned + np.array([-0.33, -0.12, 0.12, 0.33])[k % 4]  # the four corners of every tooth
    outer, around = np.array([-2.2, 1.7, 1.7, -2.2])[k % 4], np.exp(1j * TURN / teeth * along)
    rim = TURN * along + 1j * outer if straight else (teeth + outer) * around
    back = rim.real - 8j if straight else 4.0 * around
    edges = ((back, 0), (rim, 0), (rim, 9), (back, 9), (back, 0))
    points = np.stack([np.column_stack([edge.real, edge.imag, 0 * k + floor + z]) for edge, z in edges], axis=1)
    return asm.NurbsSurface(points, [np.r_[0.0, 0:n, n - 1.0] for n in points.shape[:2]], (1, 1))


def gear_train() -> tuple[asm.Assembly, asm.Revolute, asm.Prismatic]:
    ground, first = asm.Body("ground", fixed=True), asm.Body("first", toothed(12, 0))
    second = asm.Body("second", [toothed(48, 0, turned=0.5), toothed(16, 10)])
    third = asm.Body("third", [toothed(40, 10, turned=0.5), toothed(14, 20)])
    rack = asm.Body("rack", toothed(24, 20, turned=-12, straight=True))
    crank = asm.Revolute(ground.frame(), first.frame(), "crank", angle=0.0)
    shaft = asm.Revolute(ground.frame(at=(60, 0, 0)), second.frame(), "shaft")
    pinion = asm.Revolute(ground.frame(at=(116, 0, 0)), third.frame(), "pinion")
    rail = asm.Prismatic(ground.frame(at=(116, -14, 24), z=(1, 0, 0)), rack.frame(at=(0, 0, 24), z=(1, 0, 0)), "rail")
    train = asm.Assembly([ground, first, second, third, rack])
    train.constrain(crank, shaft, pinion, rail, asm.Gear(crank, shaft, -12 / 48), asm.Gear(shaft, pinion, -16 / 40))
    train.constrain(asm.RackPinion(pinion, rail, radius=14.0, offset=-7 * TURN))
    return train, crank, rail


def main() -> list[asm.Solution]:
    train, crank, rail = gear_train()
    solutions = [train.solve()]
    for angle in np.linspace(0.0, 10.0 * TURN, 241)[1:]:
        crank.angle = angle
        solutions.append(train.solve(solutions[-1]))
    asm.view.animate(train, solutions, "gear_train.html", seconds=20.0, direction=(0.2, -0.7, 1.0))
    crank.angle, rail.slide = None, 0.0
    solutions.append(train.solve(solutions[-1].q))
    for solution in [*solutions[::24], solutions[-1]]:
        turns = (f"{name} {solution.values[name + '.angle'] / TURN:8.4f}   " for name in ("crank", "shaft", "pinion"))
        print(*turns, f"rail {solution.values['rail.slide']:9.4f} mm   {solution.status.name}")
    return solutions


if __name__ == "__main__":
    main()
