"""A six-axis arm of Denavit-Hartenberg's numbers, those of the UR5, and its inverse kinematics in closed form."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import acos, atan2, cos, hypot, pi, sin

import numpy as np
from numpy.typing import NDArray

import assembly as asm

__all__ = ["Arm", "angles_of", "hand_of", "is_found"]

Array = NDArray[np.float64]
# a, d and alpha of every axis [m, rad].
DH = (
    (0.0, 0.089159, pi / 2),
    (-0.425, 0.0, 0.0),
    (-0.39225, 0.0, 0.0),
    (0.0, 0.10915, pi / 2),
    (0.0, 0.09465, -pi / 2),
    (0.0, 0.0823, 0.0),
)


def link(k: int, angle: float) -> Array:
    """The transform (4, 4) along axis k, turned by an angle."""
    a, d, alpha = DH[k]
    c, s, ca, sa = cos(angle), sin(angle), cos(alpha), sin(alpha)
    return np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]])


def hand_of(angles: Iterable[float]) -> Array:
    """Where the hand is, (4, 4)."""
    place: Array = np.eye(4)
    for k, angle in enumerate(angles):
        place = place @ link(k, angle)
    return place


def angles_of(hand: Array) -> list[list[float]]:
    """All angles (k, 6) that bring the hand there: shoulder left or right, wrist flipped or not, elbow up or down."""
    (_, a2), (_, a3) = ((k, DH[k][0]) for k in (1, 2))
    d4, d6 = DH[3][1], DH[5][1]
    wrist = hand @ [0, 0, -d6, 1]
    reach = hypot(wrist[0], wrist[1])
    found: list[list[float]] = []
    if reach < d4:
        return found
    for shoulder in (1, -1):
        first = atan2(wrist[1], wrist[0]) + shoulder * acos(d4 / reach) + pi / 2
        cosine = (hand[0, 3] * sin(first) - hand[1, 3] * cos(first) - d4) / d6
        for flip in (1, -1) if abs(cosine) < 1.0 else ():
            fifth = flip * acos(cosine)
            x, y = (hand[0, k] * sin(first) - hand[1, k] * cos(first) for k in (0, 1))
            sixth = atan2(-y / sin(fifth), x / sin(fifth))
            middle = np.linalg.inv(link(0, first)) @ hand @ np.linalg.inv(link(4, fifth) @ link(5, sixth))
            p = middle @ [0, -d4, 0, 1]
            bend = (p[0] ** 2 + p[1] ** 2 - a2**2 - a3**2) / (2.0 * a2 * a3)
            for elbow in (1, -1) if abs(bend) < 1.0 else ():
                third = elbow * acos(bend)
                second = atan2(p[1], p[0]) - atan2(a3 * sin(third), a2 + a3 * cos(third))
                last = np.linalg.inv(link(1, second) @ link(2, third)) @ middle
                found.append([first, second, third, atan2(last[1, 0], last[0, 0]), fifth, sixth])
    return found


class Arm:
    """The arm as a scene: its last link is held to a hand that stands where it is put."""

    def __init__(self) -> None:
        base, self.hand = asm.Body("base", fixed=True), asm.Body("hand", fixed=True)
        links = [asm.Body(f"link {k + 1}") for k in range(6)]
        self.scene = asm.Assembly([base, *links, self.hand])
        before = base.frame()
        self.joints = []
        for k, body in enumerate(links):
            # The axis is that of the frame before, seen from the link's own.
            seen = np.linalg.inv(link(k, 0.0))
            own = body.frame(at=seen[:3, 3], z=seen[:3, 2], x=seen[:3, 0])
            self.joints.append(asm.Revolute(before, own, f"axis {k + 1}"))
            before = body.frame()
        self.scene.constrain(*self.joints, asm.Fixed(self.hand, before, "hold"))

    def reach(self, hand: Array) -> None:
        """Put the hand to a place (4, 4)."""
        rotation = hand[:3, :3]
        # The quaternion of a rotation: half the angle, about its axis.
        values, vectors = np.linalg.eig(rotation)
        axis = np.real(vectors[:, np.argmin(np.abs(values - 1.0))])
        sine = 0.5 * np.array([rotation[k - 1, k - 2] - rotation[k - 2, k - 1] for k in range(3)]) @ axis
        angle = atan2(sine, 0.5 * (np.trace(rotation) - 1.0))
        self.hand.pose = asm.Pose(hand[:3, 3], np.array([cos(0.5 * angle), *(sin(0.5 * angle) * axis)]))


def is_found(angles: Sequence[float], solutions: Iterable[asm.Solution]) -> bool:
    """Whether a solution has these angles."""
    for solution in solutions:
        told = np.array([solution.values[f"axis {k + 1}.angle"] for k in range(6)])
        if np.abs(np.remainder(told - angles + pi, 2.0 * pi) - pi).max() < 1e-6:
            return True
    return False
