"""Four-bars of cosines: where they stand, and where they turn."""

from __future__ import annotations

from math import acos, atan2, cos, hypot, pi, sin

import numpy as np

import assembly as asm

__all__ = ["FourBar"]


class FourBar:
    """A crank, a coupler, a rocker and the ground between their hinges, with the crank at an angle."""

    def __init__(self, crank: float, coupler: float, rocker: float, ground: float, angle: float = 0.7) -> None:
        self.lengths = crank, coupler, rocker, ground
        bodies = [asm.Body("ground", fixed=True), *(asm.Body(name) for name in ("crank", "coupler", "rocker"))]
        base, first, second, third = bodies
        self.crank = asm.Revolute(base, first, "crank")
        self.pin = asm.Revolute(first.frame(at=(crank, 0, 0)), second, "pin")
        self.wrist = asm.Revolute(second.frame(at=(coupler, 0, 0)), third.frame(at=(rocker, 0, 0)), "wrist")
        self.rocker = asm.Revolute(base.frame(at=(ground, 0, 0)), third, "rocker")
        self.scene = asm.Assembly(bodies)
        self.scene.constrain(self.crank, self.pin, self.wrist, self.rocker)
        x, y = crank * cos(angle), crank * sin(angle)
        reach = hypot(ground - x, y)
        along = (coupler**2 - rocker**2 + reach**2) / (2.0 * reach)
        turn = atan2(-y, ground - x) + acos(along / coupler)
        tip = x + coupler * cos(turn), y + coupler * sin(turn)
        self.swing = atan2(tip[1], tip[0] - ground)
        places = [(0, 0, 0), (0, 0, angle), (x, y, turn), (ground, 0, self.swing)]
        self.q = np.array([[x, y, 0, cos(0.5 * a), 0, 0, sin(0.5 * a)] for x, y, a in places])

    def dead_centers(self) -> list[float]:
        """Angles of the rocker, from 0 to pi, at which crank and coupler lie along each other."""
        crank, coupler, rocker, ground = self.lengths
        cosines = [
            (ground**2 + rocker**2 - reach**2) / (2.0 * ground * rocker)
            for reach in (coupler + crank, abs(coupler - crank))
        ]
        return sorted(pi - acos(cosine) for cosine in cosines if abs(cosine) <= 1.0)
