"""A hand drags a plate over a table and presses it into the corner of two walls, a thousand times a second.

The plate lies flush on the table, and then on the walls: every tick is proven to be clear, or to touch, and so is the
way to it. The hand holds the middle of the plate by a spring, half a millimeter too low. Where the plate is to be is
known: at the hand, or as far as walls let it go there.
Prints how ticks ended, how far the plate is from there, what the hand feels and what a tick takes; writes
drag_a_plate.html, which plays the drag.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

import assembly as asm

STOP = np.array([70.0, 40.0])  # how far the middle of the plate goes until it touches the walls [mm]


def bench() -> tuple[asm.Assembly, asm.Body]:
    table = asm.Body("table", asm.shapes.box(240, 200, 20), position=(0, 0, -10), fixed=True)
    # Walls are let into the table.
    right = asm.Body("right", asm.shapes.box(20, 200, 40), position=(STOP[0] + 40, 0, 10), fixed=True)
    rear = asm.Body("rear", asm.shapes.box(180, 20, 40), position=(0, STOP[1] + 30, 10), fixed=True)
    plate = asm.Body("plate", asm.shapes.plate(60, 40, 10), position=(-40, -30, 5), color=(0.9, 0.6, 0.2))
    scene = asm.Assembly([table, right, rear, plate])
    scene.constrain(asm.Clearance())
    return scene, plate


def hand() -> asm.Trace:
    """Along the table, past the first wall, along that into the corner, and back."""
    places = [(-40, -30, 4.5), (20, -40, 4.5), (75, -10, 4.5), (75, 45, 4.5), (30, 20, 4.5)]
    return asm.Trace.through(places, times=[0.0, 0.5, 1.0, 1.5, 2.0])


def main() -> tuple[asm.Trace, list[asm.Step]]:
    scene, plate = bench()
    tracker, trace = scene.tracker(plate.point(0, 0, 0), stiffness=2.0), hand()  # [N/mm]
    tracker.step(trace.targets[0])  # lists what touches
    steps = [tracker.step(target) for target in trace.targets]
    ended = Counter(step.status.name for step in steps)
    print(", ".join(f"{count} {name}" for name, count in ended.items()), f"of {len(steps)}")
    print(f"proven: {sum(step.proved for step in steps)}")
    places = np.array([step.q[3, :2] for step in steps])
    off = np.linalg.norm(places - np.minimum(trace.targets[:, :2], STOP), axis=1)
    print(f"off where it is to be: {off.max():.1e} mm at most, {np.median(off):.1e} in the middle")
    corner = steps[1500]
    print("the hand feels in the corner [N]:", np.round(corner.force, 3) + 0.0)
    times = 1e6 * np.array([step.seconds for step in steps])
    print(f"a tick takes {np.median(times):.0f} us, 99 of 100 less than {np.percentile(times, 99):.0f}")
    poses = np.array([step.q for step in steps[::20]])
    asm.view.animate(scene, poses, "drag_a_plate.html", seconds=4.0, direction=(-0.4, -0.8, 1.0))
    return trace, steps


if __name__ == "__main__":
    main()
