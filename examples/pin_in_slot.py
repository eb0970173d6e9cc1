"""A pin is lowered into a slot and led along it; at the round end it stops, wherever the hand goes.

The pin stays upright. Its wall may touch each of the four walls of the slot but may cross none: one-sided contacts of
faces that end at edges. So the pin's axis stays in a slot that is narrower by the pin; the point there that is nearest
to the hand is known in closed form, and printed beside the one that was found. The fit is close, so the hand moves in
small steps: when the pin moves, the point at which it touches the round end moves eight times as far. Prints both and
what touches, and writes pin_in_slot.html, which plays the motion: open it in any browser.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

LENGTH, WIDTH, RADIUS, ANGLE = 60.0, 16.0, 7.0, 0.4  # of the slot, and of the pin [mm]
ALONG, LEFT = np.array([[np.cos(ANGLE), np.sin(ANGLE)], [-np.sin(ANGLE), np.cos(ANGLE)]])
WALLS = ("slot left", "slot right", "slot end", "slot start")


def pin_and_plate() -> tuple[asm.Assembly, asm.PointDistance]:
    plate = asm.Body("plate", asm.shapes.plate_with_slot(90, 60, 12, LENGTH, WIDTH, angle=ANGLE), fixed=True)
    pin = asm.Body("pin", asm.shapes.solid_cylinder(RADIUS, 30), position=(0, 0, 30))
    scene = asm.Assembly([plate, pin])
    scene.constrain(asm.Parallel(plate.frame(), pin.frame(), "upright", angle=0.0))
    for wall in WALLS:
        scene.constrain(asm.Contact(plate.face(wall), pin.face("wall"), wall, unilateral=True, edges=True))
    hand = asm.PointDistance(pin.point(0, 0, 0), target=(0, 0, 30))
    scene.minimize(hand)
    return scene, hand


def nearest(target: np.ndarray) -> np.ndarray:
    """The place of the pin's axis in the slot that is nearest to a target (2,)."""
    reach, play = 0.5 * (LENGTH - WIDTH), 0.5 * WIDTH - RADIUS
    middle = np.clip(target @ ALONG, -reach, reach) * ALONG
    away = target - middle
    return middle + away * min(1.0, play / max(np.linalg.norm(away), play))


def main() -> tuple[np.ndarray, list[asm.Solution]]:
    scene, hand = pin_and_plate()
    down = [(0.0, 0.0, z) for z in np.linspace(30.0, 2.0, 15)]
    out = [(*(x * ALONG + 6.0 * np.sin(0.15 * x) * LEFT), 2.0) for x in np.linspace(0.0, 40.0, 161)]
    targets, solutions = np.array(down + out), []
    print("hand                        pin                         nearest place          touching")
    for k, target in enumerate(targets):
        hand.target = target
        solutions.append(scene.solve(solutions[-1] if solutions else None))
        if k % 10 == 5:
            place, exact = solutions[-1].pose("pin").position, nearest(target[:2])
            touching = ", ".join(wall for wall in WALLS if abs(solutions[-1].contacts[wall].gap) < 1e-9)
            print(*(f"{x:8.3f}" for x in (*target, *place)), *(f"{x:10.6f}" for x in exact), touching, sep=" ")
    asm.view.animate(scene, solutions, "pin_in_slot.html", seconds=8.0, direction=(0.3, -1.0, 0.9))
    return targets, solutions


if __name__ == "__main__":
    main()
