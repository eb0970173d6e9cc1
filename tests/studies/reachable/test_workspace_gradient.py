"""How workspaces change with lengths and limits: closed forms, and differences of workspaces found anew."""

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


def test_an_arm_with_stops_against_workspaces_found_anew():
    """Lengths and stops. The estimates' own errors are 1e-4 of the area, over a difference of 0.06 that is 1e-2; and
    corners that go into the set make places stand for up to a cell too much, here 1.8 percent.
    """
    limits = ((-2.0, 2.5), (-2.4, 0.8))
    scene, tip, lengths, elbow = planar_arm(limits)
    stops = [asm.Parameter(elbow, "limits", 0), asm.Parameter(elbow, "limits", 1)]
    slopes = asm.workspace(scene, tip, cell=0.05, plane="xy").gradient([*lengths, *stops])
    differences = []
    for parameter in (*lengths, *stops):
        value, areas = parameter.value, []
        for step in (0.03, -0.03):
            parameter.value = value + step
            areas.append(asm.workspace(scene, tip, cell=0.05, plane="xy").estimate)
        parameter.value = value
        differences.append((areas[0] - areas[1]) / 0.06)
    np.testing.assert_allclose(slopes, differences, rtol=0.025, atol=0.04)


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
