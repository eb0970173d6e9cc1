"""A chain of three paper clips follows a hand at a thousand ticks a second, and no wire enters another.

Each clip is threaded through both others and touches them. The red one is fixed, and the hand holds the lower end of
the blue one. It moves slowly and fast, up to 0.09 m/s, and farther than the chain reaches. Wires slide along each other
and meet in new places on the way. If they wedge, a tick may find no further pose at which the constraints hold; then it
is HELD. Prints how long ticks took and how well the constraints held, and writes follow_the_hand.html, which plays the
motion: open it in any browser.
"""

from __future__ import annotations

import numpy as np

import assembly as asm

END = (0.0, 0.0, -15.0)  # of the blue clip, what the hand holds [mm]
# Seconds of each stroke, and where it ends, seen from where the hand begins.
STROKES = np.array([
    (1.2, -6, 0, 0), (1.0, 0, -6, 0),  # slowly, level
    (0.5, 6, 0, 6), (0.3, -4, -3, 4),  # faster; the chain goes slack
    (0.15, 4, -4, 2), (0.12, 8, -8, 3),  # across
    (0.25, 0, -12, 4),  # beyond reach
    (0.25, -4, 6, 0), (0.6, 0, 0, 0),  # and back to where it began
])  # fmt: skip


def paper_clips() -> asm.Assembly:
    clip = asm.shapes.paper_clip(length=33.0, width=8.0, wire_radius=0.5)  # [mm]
    red = asm.Body("red", clip, fixed=True)
    green = asm.Body("green", clip, position=(-7.0, 5.0, -23.0), quaternion=(0.904, 0.279, 0.144, 0.289))
    blue = asm.Body("blue", clip, position=(4.0, 3.0, -28.0), quaternion=(0.649, -0.063, -0.147, 0.744))
    chain = asm.Assembly([red, green, blue])
    chain.constrain(asm.Contact(red, green), asm.Contact(green, blue), asm.Contact(red, blue), asm.Clearance())
    return chain


def hand(begin: np.ndarray) -> asm.Trace:
    """The strokes, a sample a millisecond."""
    return asm.Trace.through([begin, *begin + STROKES[:, 1:]], np.append(0.0, STROKES[:, 0].cumsum()))


def main() -> asm.TrackLog:
    chain = paper_clips()
    blue = chain.body("blue")
    tracker = chain.tracker(follow=blue.point(*END))
    trace = hand(asm.Pose(*np.split(tracker.q[2], [3])).apply(END))
    log = tracker.run(trace, stride=10)
    print(trace, log, sep="\n")
    asm.view.replay(chain, log, "follow_the_hand.html", hand=trace)
    return log


if __name__ == "__main__":
    main()
