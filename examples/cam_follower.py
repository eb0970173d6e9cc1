"""A cam turns once, and a roller that touches it rises and falls: found by contact, and by the cam's offset curve.

The cam is on a driven hinge, the roller on a stem in a guide, and the cam's face is in contact with the roller's wall.
The roller's axis follows the curve that is one roller radius outside of the profile; where that curve crosses the guide
is computed from the profile's points alone, with another library's spline. Prints both, and writes cam_follower.html,
which plays the turn: open it in any browser.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.optimize import brentq

import assembly as asm

ROLLER = 8.0  # radius [mm]
AROUND = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
RADII = 25.0 + 12.0 * (0.5 - 0.5 * np.cos(AROUND)) ** 2
ONTO_Y = (0.7071, -0.7071, 0.0, 0.0)  # the quaternion that turns the guide's z axis to the world's y axis


def cam_and_roller() -> tuple[asm.Assembly, asm.Revolute]:
    guide = asm.Body("guide", asm.shapes.plate(30, 20, 10, holes=[(0, 0, 4.5)]), (0, 75, 0), ONTO_Y, fixed=True)
    cam = asm.Body("cam", asm.shapes.cam(RADII, height=10, bore=6))
    stem = asm.shapes.pipe(asm.shapes.Path(direction=(0, 1, 0)).line(60), 4)
    roller = asm.Body("roller", [*asm.shapes.solid_cylinder(ROLLER, 14), stem], position=(0, 36, 0))
    drive = asm.Revolute(guide.frame(at=(0, 0, -75), z=(0, -1, 0)), cam.frame(), "drive", angle=0.0)
    scene = asm.Assembly([guide, cam, roller])
    scene.constrain(drive, asm.Prismatic(guide.frame(at=(0, 0, -75)), roller.frame(z=(0, 1, 0)), "guide"))
    scene.constrain(asm.Contact(cam.face("cam"), roller.face("wall"), "touch"))
    return scene, drive


def heights(angles: np.ndarray) -> np.ndarray:
    """Height of the roller's axis over the cam's, by the offset of the profile."""
    points = RADII * np.exp(1j * AROUND)
    profile = CubicSpline(np.arange(25), np.append(points, points[0]), bc_type="periodic")

    def turned(t: float, angle: float) -> complex:
        """A point of the offset curve, seen from the guide."""
        return complex(profile(t) - 1j * ROLLER * profile(t, 1) / abs(profile(t, 1))) * np.exp(1j * angle)

    def height(angle: float) -> float:
        guess = 6.0 - 12.0 * angle / np.pi
        return turned(brentq(lambda t: turned(t, angle).real, guess - 4.0, guess + 4.0, xtol=1e-14), angle).imag

    return np.array([height(angle) for angle in angles])


def main() -> tuple[np.ndarray, list[asm.Solution]]:
    scene, drive = cam_and_roller()
    angles, solutions = np.linspace(0.0, 2.0 * np.pi, 73), []
    for angle in angles:
        drive.angle = angle
        solutions.append(scene.solve(solutions[-1] if solutions else None))
    print("cam [deg]   roller by contact [mm]   by the offset curve [mm]")
    for angle, exact, solution in list(zip(angles, heights(angles), solutions, strict=True))[::6]:
        found = solution.values["guide.slide"]
        print(f"{np.degrees(angle):9.1f}{found:25.12f}{exact:27.12f}   {solution.status.name}")
    asm.view.animate(scene, solutions, "cam_follower.html", seconds=6.0, direction=(0.4, -0.1, 1.0))
    return angles, solutions


if __name__ == "__main__":
    main()
