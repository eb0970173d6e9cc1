"""Proofs of pairs of bodies that are kept for the next question about the same shapes.

To pack the trees of two bodies takes longer than most looks, and the cells that looks halve are of use for the next
one. What is proven does not depend on them: a kept proof begins anew.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from threading import Lock

from assembly._turn import in_child
from assembly.geometry.faces.face import Face
from assembly.proximity.clearance.proof import ClearanceProof

__all__ = ["kept_proof"]

Key = tuple[tuple[tuple[Face, ...], ...], tuple[tuple[int, int], ...], tuple[float, ...]]
# Proofs that are kept at most; one of two bodies takes some 0.5 MB.
MOST = 64
_kept: OrderedDict[Key, ClearanceProof] = OrderedDict()
_lock = Lock()


def _begin_in_child() -> None:
    global _lock
    _lock = Lock()


in_child(_begin_in_child)


@contextmanager
def kept_proof(
    shapes: Sequence[tuple[Face, ...]], pairs: Sequence[tuple[int, int]], minimum: Sequence[float]
) -> Iterator[ClearanceProof]:
    """A proof of pairs that nobody else has until the context ends; parameters are those of `ClearanceProof`."""
    key = tuple(shapes), tuple(pairs), tuple(minimum)
    with _lock:
        proof = _kept.pop(key, None)
    if proof is None:
        proof = ClearanceProof(shapes, pairs, minimum)
    else:
        proof.begin_anew()
    yield proof
    # One in which something was raised is not kept.
    with _lock:
        _kept[key] = proof
        while len(_kept) > MOST:
            _kept.popitem(last=False)
