"""What an arm of two links reaches on its table: its elbow has stops, and a post stands in the way of its tip.

Solves draw the tip from cell to cell of the table, with all constraints; where the tip stops on the way is the
boundary. Prints the area without stops and post, where it is 4 pi l1 l2, with stops alone, and with both. Writes
workspace.html: cells are bright where the joints move the tip well.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

UPPER, FORE, TIP, POST = 300.0, 200.0, 15.0, 40.0


def arm(elbow: tuple[float, float] | None, post: bool) -> tuple[asm.Assembly, asm.Body, list[asm.Revolute]]:
    table, upper = asm.Body("table", fixed=True), asm.Body("upper arm")
    fore = asm.Body("forearm", position=(UPPER, 0, 0))
    tip = asm.Body("tip", asm.shapes.sphere(TIP), position=(UPPER + FORE, 0, 0))
    pillar = asm.Body("post", asm.shapes.solid_cylinder(POST, 100.0), position=(0, 330, 0), fixed=True)
    joints = [
        asm.Revolute(table, upper, "shoulder"),
        asm.Revolute(upper.frame(at=(UPPER, 0, 0)), fore, "elbow", limits=elbow),
    ]
    scene = asm.Assembly([table, upper, fore, tip, *([pillar] if post else [])])
    scene.constrain(*joints, asm.Fixed(fore.frame(at=(FORE, 0, 0)), tip))
    if post:
        scene.constrain(asm.Clearance([tip, pillar]))
    return scene, tip, joints


def main() -> list[asm.Workspace]:
    found = []
    for what, elbow, post in (
        ("neither", None, False),
        ("stops alone", (-2.4, 0.8), False),
        ("stops and post", (-2.4, 0.8), True),
    ):
        scene, tip, joints = arm(elbow, post)
        found.append(asm.workspace(scene, tip, cell=20.0, plane="xy"))
        print(f"{what:15s} {found[-1].estimate:8.0f} mm^2   ({len(found[-1].cells)} cells)")
    print(f"4 pi l1 l2      {4.0 * np.pi * UPPER * FORE:8.0f} mm^2")
    values = found[-1].dexterity(asm.Dexterity(tip, joints, "manipulability"))
    shown = asm.Assembly([*scene.bodies, asm.Body("reach", picture=found[-1].picture(values), fixed=True)])
    shown.constrain(*scene.constraints)
    asm.view.save_html("workspace.html", shown, direction=(0.2, -0.7, 1.0))
    return found


if __name__ == "__main__":
    main()
