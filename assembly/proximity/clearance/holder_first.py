"""Which of two bodies goes first in a proof: the one in whose bores the other one is.

Of the second body a proof knows the axis that it turns about on a way, and that a shaft which turns about its own goes
nowhere; of what stays at rest it only knows how far it is from there. A shaft that is second turns in its bore by any
angle in one look.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from assembly.geometry.faces.face import Face
from assembly.geometry.recognition.forms import Cylinder
from assembly.proximity.manifolds.elementary_faces import elementary_faces

__all__ = ["holds_first"]

# What rounding may do to radii that are equal.
ROUNDED = 1e-9


@lru_cache(maxsize=1024)
def holds_first(one: tuple[Face, ...], other: tuple[Face, ...]) -> bool:
    """Whether the second of two bodies has a bore that fits what is round of the first one better than it fits into."""
    return _slack(other, one) < _slack(one, other)


def _slack(holder: tuple[Face, ...], held: tuple[Face, ...]) -> float:
    """How many times what is round of a body the tightest bore is that takes it; infinite if none does."""
    bores, shafts = _radii(holder, is_outward=False), _radii(held, is_outward=True)
    times = [bore / shaft for bore in bores for shaft in shafts if shaft <= (1.0 + ROUNDED) * bore]
    return min(times, default=np.inf)


def _radii(faces: tuple[Face, ...], is_outward: bool) -> set[float]:
    """Radii of a body's cylinders that look one way."""
    found = elementary_faces(faces)
    return {face.form.radius for face in found if isinstance(face.form, Cylinder) and face.is_outward == is_outward}
