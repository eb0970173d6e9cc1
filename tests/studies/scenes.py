"""Scenes with clearances whose contacts come and go at places that closed forms know."""

from __future__ import annotations

import assembly as asm

__all__ = ["lifted_block", "swinging_arm"]


def swinging_arm():
    """An arm of half width 0.05 about z, a post of radius 0.1 that it meets at a right angle less asin(0.15)."""
    base = asm.Body("base", fixed=True)
    post = asm.Body("post", asm.shapes.solid_cylinder(0.1, 1.0), position=(0.0, 1.0, 0.0), fixed=True)
    arm = asm.Body("arm", asm.shapes.box(1.4, 0.1, 0.2), position=(0.6, 0.0, 0.0))
    drive = asm.Revolute(base.frame(), arm.frame(at=(-0.6, 0.0, 0.0)), "drive", angle=0.0)
    scene = asm.Assembly([base, post, arm])
    scene.constrain(drive, asm.Clearance())
    return scene, drive


def lifted_block(height):
    """An eccentric that lifts a block to 1 - 0.4 sin(angle), and a spring that holds it at a height where that is less.

    Returns scene, shaft and guide of the block.
    """
    ground, cam = asm.Body("ground", fixed=True), asm.Body("cam", asm.shapes.sphere(1.0))
    block = asm.Body("block", asm.shapes.box(4, 0.5, 4), position=(0, 1.9, 0))
    shaft = asm.Revolute(ground.frame(at=(0.4, 0, 0)), cam.frame(at=(0.4, 0, 0)), "shaft", angle=0.3)
    up = {"z": (0, 1, 0), "x": (1, 0, 0)}
    lift = asm.Prismatic(ground.frame(**up), block.frame(at=(0, -0.25, 0), **up), "lift")
    scene = asm.Assembly([ground, cam, block])
    scene.constrain(shaft, lift, asm.Clearance())
    scene.minimize(asm.PointDistance(block.point(0, -0.25, 0), (0, height, 0)))
    return scene, shaft, lift
