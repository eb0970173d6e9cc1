"""How workspaces change with lengths and limits, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.errors import InputError


def planar_arm(limits=(None, None)):
    """Two links and a tip that is a body, so that both lengths are places of frames."""
    ground, upper, fore = asm.Body("ground", fixed=True), asm.Body("upper"), asm.Body("fore")
    half = np.array([np.cos(0.25), 0.0, 0.0, np.sin(0.25)])
    fore.pose = asm.Pose((1.0, 0, 0), half)
    tip = asm.Body("tip")
    tip.pose = asm.Pose((1.0 + 0.6 * np.cos(0.5), 0.6 * np.sin(0.5), 0), half)
    scene = asm.Assembly([ground, upper, fore, tip])
    elbow = asm.Revolute(upper.frame(at=(1.0, 0, 0)), fore, "elbow", limits=limits[1])
    wrist = asm.Fixed(fore.frame(at=(0.6, 0, 0)), tip, "wrist")
    scene.constrain(asm.Revolute(ground, upper, "shoulder", limits=limits[0]), elbow, wrist)
    lengths = [asm.Parameter(elbow.frame_a, "origin", "x"), asm.Parameter(wrist.frame_a, "origin", "x")]
    return scene, tip, lengths, elbow


def spatial_arm(upper_length, fore_length):
    ground = asm.Body("ground", fixed=True)
    base, upper, fore, tip = (asm.Body(name) for name in ("base", "upper", "fore", "tip"))
    turn = (np.cos(0.4), 0, np.sin(0.4), 0)
    fore.pose = asm.Pose((upper_length, 0, 0), turn)
    tip.pose = asm.Pose((upper_length + fore_length * np.cos(0.8), 0, -fore_length * np.sin(0.8)), turn)
    scene = asm.Assembly([ground, base, upper, fore, tip])
    y = (0.0, 1.0, 0.0)
    elbow = asm.Revolute(upper.frame(at=(upper_length, 0, 0), z=y), fore.frame(z=y), "elbow")
    wrist = asm.Fixed(fore.frame(at=(fore_length, 0, 0)), tip, "wrist")
    scene.constrain(
        asm.Revolute(ground, base, "yaw"), asm.Revolute(base.frame(z=y), upper.frame(z=y), "shoulder"), elbow, wrist
    )
    return scene, tip, [asm.Parameter(joint.frame_a, "origin", "x") for joint in (elbow, wrist)]


def test_the_ring_of_two_links():
    """A = 4 pi l1 l2. A hat is off by the square of the cell: 5e-4 were seen at this cell, 2.4e-3 at its double."""
    scene, tip, lengths, _ = planar_arm()
    found = asm.workspace(scene, tip, cell=0.05, plane="xy")
    np.testing.assert_allclose(found.gradient(lengths), 4.0 * np.pi * np.array([0.6, 1.0]), rtol=1e-3)


def test_the_shell_of_a_spatial_arm():
    """V = 4 pi / 3 ((l1 + l2)^3 - |l1 - l2|^3); the inner ball has a radius of three and a half cells."""
    scene, tip, lengths = spatial_arm(1.0, 0.3)
    found = asm.workspace(scene, tip, cell=0.2)
    outer, inner = 4.0 * np.pi * np.array([1.3**2, 0.7**2])
    np.testing.assert_allclose(found.gradient(lengths), [outer - inner, outer + inner], rtol=0.03)


def area_with_stops(long, short, turns, bends):
    """The integral over circles around the base of what the elbow bent to either side reaches of them."""
    ends = sorted({0.0, *np.abs(bends)})
    total = 0.0
    for low, high in zip(ends[:-1], ends[1:], strict=True):
        bend = np.linspace(low, high, 40_001)
        middle = 0.5 * (low + high)
        ways = [way for way in (middle, -middle) if bends[0] <= way <= bends[1]]
        wide = turns[1] - turns[0]
        apart = 2.0 * np.arctan2(short * np.sin(bend), long + short * np.cos(bend))
        both = np.minimum(wide, apart) + np.minimum(wide, 2.0 * np.pi - apart)
        arc = both if len(ways) == 2 else np.full(len(bend), len(ways) * wide)
        total += np.trapezoid(arc * long * short * np.sin(bend), bend)
    return total


@pytest.mark.parametrize(
    ("turns", "bends", "cell", "off"),
    [
        # Of the largest derivative. Two pieces meet at a sharp angle in the first, whose share is off by a part of a
        # cell: 3.4e-3 were seen, 2.1e-3 at half the cell.
        ((-2.0, 2.5), (-2.4, 0.8), 0.05, 5e-3),
        ((-1.0, 2.0), (-2.0, 2.5), 0.1, 5e-3),
        ((-1.0, 2.0), (-2.0, 2.5), 0.05, 1e-3),
    ],
)
def test_an_arm_with_stops(turns, bends, cell, off):
    """Lengths and stops, by differences of the closed form: corners go out and into the set, and arcs touch."""
    scene, tip, lengths, elbow = planar_arm((turns, bends))
    stops = [asm.Parameter(elbow, "limits", k) for k in (0, 1)]
    found = asm.workspace(scene, tip, cell=cell, plane="xy").gradient([*lengths, *stops])
    numbers, expected = np.array([1.0, 0.6, *bends]), []
    for step in 1e-4 * np.eye(4):
        areas = [area_with_stops(*values[:2], turns, values[2:]) for values in (numbers + step, numbers - step)]
        expected.append((areas[0] - areas[1]) / 2e-4)
    np.testing.assert_allclose(found, expected, rtol=0, atol=off * np.abs(expected).max())


def test_a_box_of_three_slides():
    """Stops of slides: a box, whose edges and corners all go out."""
    ground, parts = asm.Body("ground", fixed=True), [asm.Body(name) for name in "xyz"]
    scene = asm.Assembly([ground, *parts])
    slides, before = [], ground
    for axis, part in zip(np.eye(3), parts, strict=True):
        slides.append(asm.Prismatic(before.frame(z=axis), part.frame(z=axis), part.name, limits=(-0.58, 0.57)))
        scene.constrain(slides[-1])
        before = part
    found = asm.workspace(scene, parts[-1], cell=0.2)
    side = 1.15**2
    expected = [side, side, -side]
    uppers = [asm.Parameter(slides[k], "limits", 1) for k in (0, 2)]
    slopes = found.gradient([*uppers, asm.Parameter(slides[1], "limits", 0)])
    np.testing.assert_allclose(slopes, expected, rtol=4e-3)


def test_other_numbers_are_told():
    scene, tip, lengths, _ = planar_arm()
    found = asm.workspace(scene, tip, cell=0.2, plane="xy")
    lengths[0].value = 1.1
    with pytest.raises(InputError, match="with which the workspace was found"):
        found.gradient(lengths)
    lengths[0].value = 1.0
    again, once = found.gradient(lengths[1]), found.gradient(lengths[1])
    assert again.shape == (1,) and again.tobytes() == once.tobytes()
    with pytest.raises(TypeError, match="expected a Parameter"):
        found.gradient([tip])
