"""Mechanisms in closed poses that are known by their geometry: all bodies stand at the world's origin."""

from __future__ import annotations

import numpy as np

import assembly as asm


def chain(axes, points, size=1.0, x=None):
    """A closed loop of links, ground first: joint k, on axis k through point k, ties link k to link k + 1."""
    links = [asm.Body("ground", fixed=True), *(asm.Body(f"link {k}") for k in range(1, len(axes)))]
    scene = asm.Assembly(links)
    for k, (axis, point) in enumerate(zip(axes, points, strict=True)):
        frames = (links[j % len(links)].frame(size * np.asarray(point), axis, x) for j in (k, k + 1))
        scene.constrain(asm.Revolute(*frames, f"joint {k + 1}"))
    return scene


def planar_four_bar(size=1.0):
    """A crank that goes around, 0.5 + 3 < 2.46 + 1.58."""
    return chain([(0, 0, 1)] * 4, [(0, 0, 0), (0.3, 0.4, 0), (2.5, 1.5, 0), (3, 0, 0)], size)


def transform(angle, length, twist):
    """Denavit and Hartenberg's step: a turn about z, a shift along x, a turn about x."""
    c, s, d, t = np.cos(angle), np.sin(angle), np.cos(twist), np.sin(twist)
    return np.array(
        [[c, -s * d, s * t, length * c], [s, c * d, -c * t, length * s], [0.0, t, d, 0.0], [0.0, 0.0, 0.0, 1.0]]
    )


def bennett(size=1.0, first=0.7):
    """Four bars whose opposite ones are the same, with sin(alpha) / a = sin(beta) / b; no axes parallel or meeting.

    tan(theta_1 / 2) tan(theta_2 / 2) = sin((beta + alpha) / 2) / sin((beta - alpha) / 2): Bennett 1903.
    """
    alpha, beta, a = 0.6, 1.1, 1.0
    b = a * np.sin(beta) / np.sin(alpha)
    ratio = np.sin(0.5 * (beta + alpha)) / np.sin(0.5 * (beta - alpha))
    second = 2.0 * np.arctan(ratio / np.tan(0.5 * first))
    frame = np.eye(4)
    axes, points = [], []
    for angle, length, twist in [(first, a, alpha), (second, b, beta), (-first, a, alpha), (-second, b, beta)]:
        axes.append(frame[:3, 2])
        points.append(frame[:3, 3])
        frame = frame @ transform(angle, length, twist)
    np.testing.assert_allclose(frame, np.eye(4), rtol=0, atol=1e-14)
    return chain(axes, points, size)


def bricard(size=1.0):
    """Six bars along edges of a cube, each at right angles to the axes at its ends: Bricard's trihedral linkage."""
    corners = [(1, 0, 0), (1, 1, 0), (1, 1, 1), (0, 1, 1), (0, 0, 1), (0, 0, 0)]
    return chain([(0, 0, 1), (1, 0, 0), (0, 1, 0)] * 2, corners, size)


def parallelograms(count, size=1.0):
    """Squares in a row with common sides, folded flat: every bar lies along x."""
    ground = asm.Body("ground", fixed=True)
    rods = [asm.Body(f"rod {k}") for k in range(count + 1)]
    couplers = [asm.Body(f"coupler {k}") for k in range(count)]
    scene = asm.Assembly([ground, *rods, *couplers])

    def hinge(a, b, x, name):
        scene.constrain(asm.Revolute(a.frame((size * x, 0, 0)), b.frame((size * x, 0, 0)), name))

    for k, rod in enumerate(rods):
        hinge(ground, rod, k, f"foot {k}")
    for k, coupler in enumerate(couplers):
        hinge(rods[k], coupler, k + 1, f"left {k}")
        hinge(coupler, rods[k + 1], k + 2, f"right {k}")
    return scene
