"""A proof that is kept tells what a new one does, whatever it was asked before; who holds one holds it alone."""

from __future__ import annotations

import numpy as np
import pytest

import assembly as asm
from assembly.proximity.clearance.kept_proofs import kept_proof
from assembly.proximity.clearance.proof import ClearanceProof
from tests.proximity.clearance.scenes import at, direction, poses, proof_of


def test_answers_are_those_of_a_new_proof():
    fresh = proof_of(asm.shapes.plate(3.0, 2.0, 0.3, [(0.0, 0.0, 0.4)]), asm.shapes.solid_cylinder(0.39, 1.0))
    asked, rng = (fresh.faces, fresh.pairs, fresh.minimum.tolist()), np.random.default_rng(0)
    for _ in range(20):
        q = poses(at(*(0.3 * direction(rng))))
        with kept_proof(*asked) as kept:
            (answer,) = kept.look(q, 1e-8)
        (new,) = ClearanceProof(*asked).look(q, 1e-8)
        assert answer.verdict is new.verdict
        assert (answer.bound, answer.depth) == pytest.approx((new.bound, new.depth), abs=1e-12)


def test_one_at_a_time():
    faces = proof_of(asm.shapes.box(1.0, 1.0, 1.0), asm.shapes.box(1.0, 1.0, 2.0)).faces
    with kept_proof(faces, [(0, 1)], [0.0]) as one, kept_proof(faces, [(0, 1)], [0.0]) as other:
        assert one is not other
    with kept_proof(faces, [(0, 1)], [0.0]) as again:
        assert again in (one, other)
    with pytest.raises(ZeroDivisionError), kept_proof(faces, [(0, 1)], [0.0]) as spoilt:
        raise ZeroDivisionError
    with kept_proof(faces, [(0, 1)], [0.0]) as last:
        assert last is not spoilt
