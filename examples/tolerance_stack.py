"""How exactly a piston stops when the parts of its crank mechanism scatter, and which part to make better.

The lengths of crank and rod and the angle of the crank are normally distributed. Prints the scatter of the piston by
root sum square, its worst case, the shift of the mean, and the shares of the three; then the same from 2,000 samples
that are solved, and how many of them stop within the limits. Writes tolerance_stack.html, the mechanism, and
tolerance_stack.png where matplotlib is installed.
"""

from __future__ import annotations

from importlib.util import find_spec

import assembly as asm

RADIUS, LENGTH, ANGLE = 2.0, 5.0, 0.7
LIMIT = 0.05


def main() -> asm.Tolerances:
    ground, crank, rod = asm.Body("ground", fixed=True), asm.Body("crank"), asm.Body("rod", position=(1.5, 1.3, 0))
    piston = asm.Body("piston", position=(6, 0, 0))
    hinge = asm.Revolute(ground, crank, "hinge", angle=ANGLE)
    pin = asm.Revolute(crank.frame(at=(RADIUS, 0, 0)), rod, "pin")
    wrist = asm.Revolute(rod.frame(at=(LENGTH, 0, 0)), piston, "wrist")
    guide = asm.Prismatic(ground.frame(z=(1, 0, 0)), piston.frame(z=(1, 0, 0)), "guide")
    scene = asm.Assembly([ground, crank, rod, piston])
    scene.constrain(hinge, pin, wrist, guide)
    solution, stop = scene.solve(), asm.Measure(guide, name="stop")
    scatter = {
        asm.Parameter(pin.frame_a, "origin", "x", name="crank"): asm.Normal(0.01),
        asm.Parameter(wrist.frame_a, "origin", "x", name="rod"): asm.Normal(0.02),
        asm.Parameter(hinge, "angle", name="angle"): asm.Normal(0.005),
    }
    middle = stop.value(solution)
    found = asm.tolerances(
        scene, solution, stop, scatter, samples=2000, limits={stop: (middle - LIMIT, middle + LIMIT)}
    )
    print(found)
    asm.view.save_html("tolerance_stack.html", scene, solution)
    if find_spec("matplotlib"):
        found.plot().savefig("tolerance_stack.png", dpi=80)
    return found


if __name__ == "__main__":
    main()
