"""A bracket is bolted onto a plate, and a lever hangs in it: faces are picked by what they are, and mated.

No coordinates of holes are needed: the top of the plate is its highest face, a hole is a hollow cylinder, a bolt's
shank is its thinner cylinder. A mate says what belongs together, and how many degrees of freedom it takes away. Prints
the mates, what they leave free, and where parts end; writes mates_of_faces.html, to be opened in any browser.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

curves, shapes = asm.curves, asm.shapes
HOLE, SHANK, HEAD, EYE, PIN = 3.0, 2.9, 5.0, 4.0, 3.8  # radii [mm]


# A drawing's x and y become y and z.
UPRIGHT = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def parts() -> list[asm.Body]:
    """What there is, and where it happens to lie."""
    plate = shapes.plate(80.0, 50.0, 8.0, [(-15.0, -18.0, HOLE), (-15.0, 18.0, HOLE)])
    foot = shapes.plate(30.0, 50.0, 6.0, [(-5.0, -18.0, HOLE), (-5.0, 18.0, HOLE)])
    cheek = shapes.extrusion(
        curves.polygon([(-10, 0), (10, 0), (10, 30), (-10, 30)]), 6.0, [curves.circle(EYE, (0, 20))]
    )
    near, far = ([face.transformed(UPRIGHT, (x, 0.0, 3.0)) for face in cheek] for x in (-11.0, 11.0))
    bolt = shapes.revolution(curves.polygon([(0, -14), (SHANK, -14), (SHANK, 0), (HEAD, 0), (HEAD, 4), (0, 4)]))
    arm = shapes.extrusion(curves.polygon([(-6, -50), (6, -50), (6, 6), (-6, 6)]), 14.0)
    lever = shapes.joined(pin=shapes.solid_cylinder(PIN, 34.0), arm=arm)
    return [
        asm.Body("plate", plate, fixed=True),
        asm.Body("bracket", shapes.joined(foot=foot, near=near, far=far), (50.0, -30.0, 45.0), (0.5, 0.5, 0.5, 0.5)),
        asm.Body("left bolt", bolt, (-60.0, 10.0, 50.0), (0.8, 0.6, 0.0, 0.0)),
        asm.Body("right bolt", bolt, (-70.0, -20.0, 30.0), (0.6, 0.0, 0.8, 0.0)),
        asm.Body("lever", lever, (10.0, 60.0, 60.0), (0.8, 0.0, 0.6, 0.0)),
    ]


def mated() -> asm.Assembly:
    """What belongs together."""
    plate, bracket, left, right, lever = bodies = parts()
    holes = plate.faces.cylinders(hole=True)
    mouths = bracket.edges.of(bracket.face("foot top")).circles(HOLE)
    eyes = bracket.faces.cylinders(EYE)
    scene = asm.Assembly(bodies)
    scene.constrain(
        # The foot of the bracket lies on the plate, with its holes over those of the plate.
        asm.Flush(plate.faces(">Z"), bracket.faces("<Z"), "foot on plate"),
        asm.Coaxial(holes("<Y"), mouths("<Y"), "left hole"),
        asm.Coaxial(holes(">Y"), mouths(">Y"), "right hole"),
        # In each hole is a bolt, with its head on the foot.
        asm.Insert(mouths("<Y"), left.faces.cylinders(SHANK), "left bolt in hole"),
        asm.Insert(mouths(">Y"), right.faces.cylinders(SHANK), "right bolt in hole"),
        # The pin of the lever is in the eyes, its arm in the middle between them.
        asm.Coaxial(eyes("<X"), lever.faces.cylinders(PIN), "pin in eyes"),
        asm.Width(
            (bracket.face("near top"), bracket.face("far bottom")),
            (lever.face("arm bottom"), lever.face("arm top")),
            "arm between eyes",
        ),
    )
    return scene


def main() -> tuple[asm.Assembly, asm.Solution]:
    scene = mated()
    solution = scene.solve()
    mobility = scene.mobility(solution)
    print(f"{solution.status.name}, {mobility.dof} degrees of freedom: each bolt turns, and the lever swings")
    for mate in scene.constraints:
        print(f"{mate.name:20} {type(mate).__name__:8} takes away {mate.removes}")
    print("part             x [mm]     y [mm]     z [mm]")
    for body in scene.bodies:
        x, y, z = solution.pose(body).position.round(6) + 0.0
        print(f"{body.name:12}{x:11.6f}{y:11.6f}{z:11.6f}")
    asm.view.save_html("mates_of_faces.html", scene, solution)
    return scene, solution


if __name__ == "__main__":
    main()
