"""Bricard's ring of six tetrahedra, which by Grubler's count cannot move, turns inside out.

Its hinges start at six corners of a cube, each across the two edges that meet there. What the last hinge asks beyond
the others, these ask already: one freedom is left. Two hinges in turn are driven by half a turn, there and back.
Prints the mobility and the hinges' angles, and writes bricard.html, which plays the motion: open it in any browser.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

CORNERS = 40.0 * np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1), (0, 0, 1)])  # [mm]
EDGES = np.roll(CORNERS, -1, axis=0) - CORNERS
AXES = np.cross(np.roll(EDGES, 1, axis=0), EDGES) / 40.0**2
NAMES = ("one", "two", "three", "four", "five", "six")


def tetrahedron(k: int) -> list[asm.NurbsSurface]:
    """Four triangles between 40 mm of hinge k and 40 mm of the next; every second one is a mirror image."""
    ends = np.array([CORNERS[j % 6] + side * AXES[j % 6] for j in (k, k + 1) for side in (-20.0, 20.0)])
    triangles = [corners[:: (-1) ** k] for corners in ((0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2))]
    line = [0.0, 0.0, 1.0, 1.0]
    return [asm.NurbsSurface(ends[[[a, b], [c, c]]], (line, line), (1, 1)) for a, b, c in triangles]


def bricard() -> tuple[asm.Assembly, list[asm.Revolute]]:
    bodies = [asm.Body(name, tetrahedron(k), fixed=k == 0) for k, name in enumerate(NAMES)]
    sides = [(bodies[k - 1].frame(CORNERS[k], AXES[k]), bodies[k].frame(CORNERS[k], AXES[k])) for k in range(6)]
    hinges = [asm.Revolute(*frames, f"hinge {k + 1}") for k, frames in enumerate(sides)]
    ring = asm.Assembly(bodies)
    ring.constrain(*hinges)
    return ring, hinges


def main() -> tuple[asm.Mobility, list[asm.Solution]]:
    ring, hinges = bricard()
    mobility = ring.mobility()
    print(mobility)
    solutions = [ring.solve()]
    for driven, begin, end in ((0, 0.0, -np.pi), (1, 0.0, -np.pi), (0, -np.pi, 0.0), (1, -np.pi, 0.0)):
        hinges[1 - driven].angle = None
        for angle in np.linspace(begin, end, 31)[1:]:
            hinges[driven].angle = angle
            solutions.append(ring.solve(solutions[-1].q))
    for solution in solutions[::10]:
        angles = (f"{np.degrees(solution.values[hinge.name + '.angle']):9.3f}" for hinge in hinges)
        print("hinges [deg]", *angles, f"  {solution.status.name}")
    asm.view.animate(ring, solutions, "bricard.html", seconds=12.0)
    return mobility, solutions


if __name__ == "__main__":
    main()
