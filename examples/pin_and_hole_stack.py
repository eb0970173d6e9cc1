"""How far a pin's end is off when it stands loose in its hole, and what of that is play and what are tolerances.

A pin of diameter 8 stands in a hole of 8.4 in a plate 12 thick, and leans as far as the hole lets it; its end is in the
plane 20 above the plate. The place of the hole, its height and the height at which the end is looked at scatter. Prints
the range of the end by play alone, and then the stack with play as a contribution of its own. Without it the stack
would be wrong by the play. Writes pin_and_hole_stack.html, the pin as far as it goes to one side.
"""

from __future__ import annotations

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
    return Stack(loose, found)


if __name__ == "__main__":
    main()
