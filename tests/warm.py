"""Compiles the kernels that most tests ask for, so that test processes find them: ``python -m tests.warm``."""

from __future__ import annotations

import assembly as asm


def main() -> None:
    """Solve a scene of solids, one of a contact with a trim, and one with a clearance."""
    floor = asm.Body("floor", asm.shapes.plate(4.0, 4.0, 1.0, holes=[(0.0, 0.0, 0.5)]), fixed=True)
    ball = asm.Body("ball", asm.shapes.sphere(0.5), position=(1.2, 0.2, 2.0))
    solids = asm.Assembly([floor, ball])
    solids.constrain(asm.Contact(floor, ball))
    assert solids.solve().success
    top = floor.face("top")
    trimmed = asm.Assembly([floor, ball])
    touch = asm.Contact(top, ball)
    trimmed.constrain(touch, asm.TrimContact(touch, top.face.holes[0], keep="outside"))
    assert trimmed.solve().success
    apart = asm.Assembly([floor, ball])
    apart.constrain(asm.Clearance())
    assert apart.solve().success
    # What tests in fresh interpreters ask for: there the first compile says so, among what they print.
    pair = asm.proximity.extremal_pair(ball.face(), ball.q, ball.face(), floor.q)
    asm.proximity.gap_hessian(ball.face(), ball.q, ball.face(), floor.q, pair.parameters)


if __name__ == "__main__":
    main()
