"""The planar four-bar in space: its rocker, its coupler curve, and the two others that draw the same curve.

In the complex plane, the ground pivots at 0 and d, the crank a e^(i t) ends at A; with the diagonal f = d - A the
coupler's other end is B = A + b f/|f| e^(+-i s), cos s = (b^2 + |f|^2 - c^2) / (2 b |f|) (law of cosines).
All hinges are parallel: Gruebler counts -2 freedoms, there is 1.
"""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from tests.validation.mechanisms import (
    CLOSE,
    Counter,
    angles,
    assert_came_back,
    degrees,
    drive,
    places,
    planar,
    shake,
)

CRANK_ROCKER = (1.0, 3.0, 2.5, 3.2)
DRAG_LINK = (2.0, 2.3, 2.5, 1.0)
COUPLER_POINT = 0.4 + 0.7j  # in units of the coupler, from A toward B


def closed_form(links, t, branch=1):
    """A and B as complex numbers."""
    a, b, c, d = links
    crank = a * np.exp(1j * t)
    f = d - crank
    s = np.arccos((b**2 + np.abs(f) ** 2 - c**2) / (2 * b * np.abs(f)))
    return crank, crank + b * f / np.abs(f) * np.exp(1j * branch * s)


class FourBar:
    """One four-bar with its pivots on the ground at p and p + d u, |u| = 1, at a crank angle from u."""

    def __init__(self, ground, links, t, branch=1, name="", p=0.0, u=1.0):
        a, b, c, d = links
        near, far = (p + u * end for end in closed_form(links, t, branch))
        pivots = [complex(p), complex(p + d * u)]
        self.bodies = [
            planar(f"{name}{bar}", (at.real, at.imag), np.angle(along))
            for bar, at, along in (
                ("crank", pivots[0], near - pivots[0]),
                ("coupler", complex(near), far - near),
                ("rocker", pivots[1], far - pivots[1]),
            )
        ]
        crank, self.coupler, rocker = self.bodies
        along = (u.real, u.imag, 0)
        base, top = (ground.frame((z.real, z.imag, 0), x=along) for z in pivots)
        self.crank = asm.Revolute(base, crank, f"{name}crank pivot")
        self.rocker = asm.Revolute(top, rocker, f"{name}rocker pivot")
        self.constraints = [
            self.crank,
            asm.Revolute(crank.frame((a, 0, 0)), self.coupler, f"{name}A"),
            asm.Revolute(self.coupler.frame((b, 0, 0)), rocker.frame((c, 0, 0)), f"{name}B"),
            self.rocker,
        ]


def single(links, branch=1):
    ground = planar("ground", fixed=True)
    bar = FourBar(ground, links, 0.1, branch)
    shake(bar.bodies, 0.05)
    counter = Counter(ground, bar.rocker, start=1.5 * branch)
    scene = asm.Assembly([ground, *bar.bodies, counter.rack])
    scene.constrain(*bar.constraints, *counter.constraints)
    return scene, bar, counter


def as_complex(points):
    assert np.abs(points[:, 2]).max() < CLOSE
    return points[:, 0] + 1j * points[:, 1]


@pytest.mark.parametrize("branch", [1, -1])
@pytest.mark.parametrize("links", [CRANK_ROCKER, DRAG_LINK])
def test_rocker_and_coupler_curve(links, branch):
    scene, bar, counter = single(links, branch)
    t = degrees(turns=2)
    solutions = drive(scene, bar.crank.freedom(), t)
    a, b, c, d = links
    near, far = closed_form(links, t, branch)
    traced = bar.coupler.point(*(b * np.array([COUPLER_POINT.real, COUPLER_POINT.imag, 0])))
    curve = near + COUPLER_POINT * (far - near)
    assert np.abs(as_complex(places(solutions, traced)) - curve).max() < CLOSE * d
    rocker = np.unwrap(np.angle(far - d))
    assert np.abs(angles(solutions, bar.rocker) - rocker).max() < CLOSE
    # The angle that the solver itself goes by has not jumped either: two turns of the drag link, none of a rocker.
    assert np.abs(counter.read(solutions) - rocker).max() < CLOSE
    assert round((rocker[-1] - rocker[0]) / (2 * np.pi), 9) == (2 if links is DRAG_LINK else 0)
    if links is CRANK_ROCKER:
        assert_came_back(solutions[0], solutions[-1])


def test_backwards_in_uneven_steps():
    scene, bar, counter = single(DRAG_LINK)
    rng = np.random.default_rng(3)
    t = np.concatenate([[0.0], -np.cumsum(rng.uniform(0.01, 0.5, 60))])
    solutions = drive(scene, bar.crank.freedom(), t)
    rocker = np.unwrap(np.angle(closed_form(DRAG_LINK, t)[1] - DRAG_LINK[3]))
    # Rows hold to 2e-13 of the size; some of these poses turn the rocker by several times what they move the links.
    assert np.abs(counter.read(solutions) - rocker).max() < 3 * CLOSE and rocker[-1] < -3 * np.pi


def test_three_cognates_pinned_together_move():
    """Roberts and Chebyshev: three four-bars draw every coupler curve; pinned at the point that draws it, they move.

    With k = (P - A) / (B - A) the left one stands on 0 and k d and has the bars |k| (b, a, c), the right one stands
    on d and k d and has |1 - k| (b, c, a); Gruebler counts -16 freedoms, there is 1.
    """
    k, start = COUPLER_POINT, 0.1
    a, b, c, d = CRANK_ROCKER
    ground = planar("ground", fixed=True)
    bars = [FourBar(ground, CRANK_ROCKER, start, 1, "first ")]
    ends = closed_form(CRANK_ROCKER, start)
    # (ratio, base pivot, direction of the base, bars, direction of the crank), cranks parallel to AP and BP.
    sides = [
        (k, 0.0, k / abs(k), (b, a, c), k * (ends[1] - ends[0])),
        (1 - k, d, -(1 - k) / abs(1 - k), (b, c, a), (1 - k) * (ends[0] - ends[1])),
    ]
    follows = {"left ": k * ends[0], "right ": (1 - k) * (ends[1] - d)}
    for name, (ratio, p, u, lengths, crank) in zip(follows, sides, strict=True):
        links = tuple(abs(ratio) * length for length in (*lengths, d))
        t = np.angle(crank / u)
        # The branch whose coupler goes with the first one's crank, or rocker.
        couplers = {side: np.subtract(*closed_form(links, t, side)[::-1]) * u for side in (1, -1)}
        branch = min(couplers, key=lambda side, couplers=couplers, name=name: abs(couplers[side] - follows[name]))
        bars.append(FourBar(ground, links, t, branch, name, p, u))
    points = [k, 1 / k, 1 / (1 - k)]
    places_of_pins = [b * points[0], abs(k) * a * points[1], abs(1 - k) * c * points[2]]
    pins = [bar.coupler.frame((z.real, z.imag, 0)) for bar, z in zip(bars, places_of_pins, strict=True)]
    scene = asm.Assembly([ground, *(body for bar in bars for body in bar.bodies)])
    scene.constrain(*(row for bar in bars for row in bar.constraints))
    scene.constrain(*(asm.Revolute(pins[0], pin, f"pin {name}") for pin, name in zip(pins[1:], "lr", strict=True)))
    shake(scene.bodies, 0.02)
    t = degrees(turns=2)
    solutions = drive(scene, bars[0].crank.freedom(), t)
    near, far = closed_form(CRANK_ROCKER, t)
    for pin in pins:
        drawn = as_complex(places(solutions, pin.body.point(*pin.origin)))
        assert np.abs(drawn - (near + k * (far - near))).max() < CLOSE * d
    # The left coupler turns with the first crank, the right one with the first rocker.
    for bar, turn in zip(bars[1:], (t, np.unwrap(np.angle(far - d))), strict=True):
        found = angles(solutions, asm.Parallel(ground, bar.coupler))
        assert np.abs(found - found[0] - (turn - turn[0])).max() < CLOSE
    assert_came_back(solutions[0], solutions[-1], d)
