"""How far a piston moves when a dimension of its crank mechanism changes a little.

The crank is driven to an angle; the positions of the hinges' frames on the bodies are the lengths of crank and rod.
Prints the piston's position, its derivatives beside those of the closed form, and the effect of a longer crank: by the
derivative, and solved with the new length. Writes slider_crank_sensitivity.html, to be opened in any browser, and,
where matplotlib is installed, slider_crank_sensitivity.png: the piston all around, and its tangent at the angle.
"""

from __future__ import annotations

from importlib.util import find_spec

import numpy as np

import assembly as asm

RADIUS, LENGTH, ANGLE, LONGER = 2.0, 5.0, 0.7, 0.01


def slider_crank() -> tuple[asm.Assembly, asm.Measure, list[asm.Parameter]]:
    ground, crank, rod = asm.Body("ground", fixed=True), asm.Body("crank"), asm.Body("rod", position=(1.5, 1.3, 0))
    piston = asm.Body("piston", position=(6, 0, 0))
    hinge = asm.Revolute(ground, crank, "hinge", angle=ANGLE)
    pin = asm.Revolute(crank.frame(at=(RADIUS, 0, 0)), rod, "pin")
    wrist = asm.Revolute(rod.frame(at=(LENGTH, 0, 0)), piston, "wrist")
    guide = asm.Prismatic(ground.frame(z=(1, 0, 0)), piston.frame(z=(1, 0, 0)), "guide")
    scene = asm.Assembly([ground, crank, rod, piston])
    scene.constrain(hinge, pin, wrist, guide)
    places = {"crank": pin.frame_a, "rod": wrist.frame_a}
    lengths = [asm.Parameter(frame, "origin", "x", name=name) for name, frame in places.items()]
    return scene, asm.Measure(guide, name="stroke"), [asm.Parameter(hinge, "angle", name="angle"), *lengths]


def closed_form() -> np.ndarray:
    """x = r cos(angle) + sqrt(l^2 - r^2 sin(angle)^2), derived by hand."""
    cosine, sine = np.cos(ANGLE), np.sin(ANGLE)
    along = np.sqrt(LENGTH**2 - (RADIUS * sine) ** 2)
    return np.array([-RADIUS * sine * (1 + RADIUS * cosine / along), cosine - RADIUS * sine**2 / along, LENGTH / along])


def main() -> tuple[asm.Sensitivity, np.ndarray, float, float]:
    scene, stroke, (angle, radius, length) = slider_crank()
    solution = scene.solve()
    d = asm.sensitivity(scene, solution, of=stroke, wrt=[angle, radius, length])
    print(f"the piston is at {stroke.value(solution):.12f}", d, sep="\n")
    print("closed form:", *(f"{value:.8g}" for value in closed_form()))
    asm.view.save_html("slider_crank_sensitivity.html", scene, solution)
    if find_spec("matplotlib"):
        around = asm.study(scene, asm.grid({angle: np.linspace(0.0, 2.0 * np.pi, 121)}), stroke).plot()
        around.axline((ANGLE, stroke.value(solution)), slope=d[stroke, angle], color="tab:red", linestyle="--")
        around.figure.savefig("slider_crank_sensitivity.png", dpi=80)
    radius.value += LONGER
    moved = stroke.value(scene.solve(solution)) - stroke.value(solution)
    print(f"a crank longer by {LONGER}: {LONGER * d[stroke, radius]:.8f} by the derivative, {moved:.8f} solved anew")
    return d, closed_form(), LONGER * d[stroke, radius], moved


if __name__ == "__main__":
    main()
