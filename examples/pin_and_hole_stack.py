"""How far the end of a loose pin in its hole may be off, and how much of that is due to play and to tolerances.

A pin of diameter 8 stands in a hole of 8.4 in a plate 12 thick, and tilts as far as the hole allows; its end is in the
plane 20 above the plate. The position of the hole, its height and the height of the end scatter. Prints the range of
the end due to play alone, and then the stack with play as a contribution of its own, without which the stack would be
wrong. Writes pin_and_hole_stack.html, with the pin tilted to one side, and pin_and_hole_stack.png, the stack with its
contributions, where matplotlib is installed.
"""

from __future__ import annotations

from importlib.util import find_spec
from typing import NamedTuple

import assembly as asm

HOLE, PIN, THICKNESS, ABOVE = 8.4, 8.0, 12.0, 20.0


class Stack(NamedTuple):
    """The range by play, and the stack with it."""

    play: asm.Play
    tolerances: asm.Tolerances


def main() -> Stack:
    bench = asm.Body("bench", fixed=True)
    plate = asm.Body("plate", asm.shapes.plate(40, 40, THICKNESS, holes=[(0, 0, HOLE / 2)]))
    pin = asm.Body("pin", asm.shapes.solid_cylinder(PIN / 2, 60), position=(0, 0, -4))
    seat = asm.Fixed(bench, plate, "seat")
    end, height = pin.point(0, 0, 30), bench.frame(at=(0, 0, THICKNESS / 2 + ABOVE))
    level = asm.PointOnPlane(end, height, "level")
    scene = asm.Assembly([bench, plate, pin])
    scene.constrain(seat, level, asm.Clearance([plate, pin]))
    solution, off = scene.solve(), asm.Measure(end, "x", name="off")
    loose = asm.play(scene, solution, off)
    print(loose)
    scatter = {
        asm.Parameter(seat.frame_a, "origin", "x", name="place of the hole"): asm.Normal(0.05),
        asm.Parameter(seat.frame_a, "origin", "z", name="height of the plate"): asm.Uniform(0.5),
        asm.Parameter(height, "origin", "z", name="height of the end"): asm.Uniform(0.2),
    }
    found = asm.tolerances(scene, solution, off, scatter, play=True)
    print(found)
    asm.view.save_html("pin_and_hole_stack.html", loose.most.scene, loose.most.solution)
    if find_spec("matplotlib"):
        found.plot().savefig("pin_and_hole_stack.png", dpi=80)
    return Stack(loose, found)


if __name__ == "__main__":
    main()
