"""A chain of three paper clips follows a hand at a thousand ticks a second, and no wire enters another.

Each clip is threaded through both others and touches them. The red one is held, the hand has the lower end of the blue
one: it goes slowly and fast, up to 0.3 m/s, pulls farther than the chain reaches, and goes around. Contacts slide along
the wires; others come and go where wires meet on the way, and the log says when.
Prints how long ticks took and how well the constraints held, and writes follow_the_hand.html, which plays the motion:
open it in any browser.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

END = (0.0, 0.0, -15.0)  # of the blue clip, what the hand holds [mm]
# Where the hand goes, beside where it begins, and the seconds it takes from the place before.
STROKES = np.array([
    (0.0, 0, 0, 0),
    (1.5, 6, 0, 6),  # slowly up: the chain goes slack
    (1.5, -4, 6, 9),
    (1.0, -12, -4, 4),
    (0.2, 13, -7, 5),  # across, fast
    (0.1, -12, 6, 2),  # and back
    (0.3, -8, 6, -4),
    (1.5, -4, 2, -25),  # a pull beyond reach
    (1.0, -4, 2, -25),
    (1.0, 12, 10, -14),
    (0.6, 16, -2, -3),  # once around
    (0.6, 8, -16, 3),
    (0.6, -10, -14, 4),
    (0.6, -18, 2, 0),
    (0.6, -8, 14, -3),
    (0.3, 14, 12, -1),
    (0.15, -8, -14, 6),
    (0.4, -10, -8, 12),
    (0.8, 0, 0, 16),  # up into the others
    (1.2, 0, 0, 0),
])  # fmt: skip


def paper_clips() -> asm.Assembly:
    clip = asm.shapes.paper_clip(length=33.0, width=8.0, wire_radius=0.5)  # [mm]
    red = asm.Body("red", clip, fixed=True)
    green = asm.Body("green", clip, position=(-7.0, 5.0, -23.0), quaternion=(0.904, 0.279, 0.144, 0.289))
    blue = asm.Body("blue", clip, position=(4.0, 3.0, -28.0), quaternion=(0.649, -0.063, -0.147, 0.744))
    chain = asm.Assembly([red, green, blue])
    chain.constrain(asm.Contact(red, green), asm.Contact(green, blue), asm.Contact(red, blue), asm.Clearance())
    return chain


def hand(begin: np.ndarray, rounds: int = 1) -> asm.Trace:
    """The strokes, and once more in another direction for every further round, a sample a millisecond."""
    points, times = [begin], [0.0]
    for turn in np.radians(137.5) * np.arange(rounds):
        c, s = np.cos(turn), np.sin(turn)
        points.extend(begin + STROKES[1:, 1:] @ [[c, s, 0], [-s, c, 0], [0, 0, 1]])
        times.extend(times[-1] + np.cumsum(STROKES[1:, 0]))
    return asm.Trace.through(points, times)


def main() -> asm.TrackLog:
    chain = paper_clips()
    blue = chain.body("blue")
    tracker = chain.tracker(follow=blue.point(*END))
    trace = hand(asm.Pose(tracker.q[2, :3], tracker.q[2, 3:]).apply(END))
    log = tracker.run(trace, stride=10)
    print(trace)
    print(log)
    asm.view.replay(chain, log, "follow_the_hand.html", hand=trace, frames=600)
    return log


if __name__ == "__main__":
    main()
