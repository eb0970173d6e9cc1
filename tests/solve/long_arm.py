"""A solve that takes long enough to be interrupted."""

from __future__ import annotations

import assembly as asm


def long_arm(links: int = 250) -> asm.Assembly:
    """A chain of links that is drawn to the other side of its base: a thousand steps, of half a millisecond each."""
    bodies = [asm.Body("ground", fixed=True), *(asm.Body(f"link {k}", position=(k, 0, 0)) for k in range(links))]
    scene = asm.Assembly(bodies)
    for k, (a, b) in enumerate(zip(bodies, bodies[1:], strict=False)):
        scene.constrain(asm.Revolute(a.frame(at=(float(k > 0), 0, 0)), b.frame(), f"hinge {k}"))
    scene.minimize(asm.PointDistance(bodies[-1].point(1, 0, 0), target=(-0.3 * links, 0.5 * links, 0.0)))
    return scene
