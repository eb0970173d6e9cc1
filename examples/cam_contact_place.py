"""A cam turns until it touches its roller at a given line: a contact drawn to a line of a face, and held off by a stop.

The roller hangs on a lever. The contact is drawn to a line of the cam's face, and ends on it, wherever around the cam
that is. If a stop of the lever prevents that, it comes as near as it can, measured along the face.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

ground = asm.Body("ground", fixed=True)
cam = asm.Body("cam", asm.shapes.ellipsoid(2.0, 1.2, 1.0))
roller = asm.Body("roller", asm.shapes.sphere(0.5), (0.4, 1.8, 0.0))
shaft = asm.Revolute(ground, cam, "shaft")
lever = asm.Revolute(ground.frame((-3.0, 1.8, 0.0)), roller.frame((-3.4, 0.0, 0.0)), "lever")
touch = asm.Contact(cam, roller, "touch")
scene = asm.Assembly([ground, cam, roller])
scene.constrain(shaft, lever, touch)

low, high = cam.face().face.surface.domain[0]  # u goes around the cam
place = asm.ContactPlace(touch, "a", (low + 0.3 * (high - low), None))
scene.minimize(place)
solution = scene.solve()

turns, lifts = [], []
for part in np.linspace(0.3, 1.3, 73):
    place.target = (low + part * (high - low), None)
    solution = scene.solve(solution)
    turns.append(solution.values["shaft.angle"])
    lifts.append(solution.values["lever.angle"])

place.target = (low + 0.5 * (high - low), None)
highest = scene.solve(solution)  # the cam's long end
lever.limits = (-0.5, float(np.mean(lifts)))
limited = scene.solve(highest.q)
missed = float(np.sqrt(limited.objective))  # along the cam's face

if __name__ == "__main__":
    import matplotlib.pyplot as plt

    print(f"lever {highest.values['lever.angle']:.4f} at the long end, {limited.values['lever.angle']:.4f} at its stop")
    print(f"with the stop the contact misses its line by {missed:.4f}")
    figure, axes = plt.subplots()
    axes.plot(np.degrees(np.unwrap(turns)), np.degrees(lifts), label="targets around the cam")
    axes.plot(*np.degrees([limited.values["shaft.angle"], limited.values["lever.angle"]]), "o", label="at the stop")
    axes.set(xlabel="shaft [deg]", ylabel="lever [deg]")
    axes.legend()
    figure.savefig("cam_contact_place.png")
