"""Sizes that bodies may have whose points are tracked by contacts and clearances.

Where two surfaces are nearest is told by determinants of four factors, each of which may be a length of a surface's
parameters to the power -1 or 1, and whether facets cross by ones of four lengths in space. Beyond these sizes they
overflow or vanish, and a contact would be lost, or a crossing not seen.
"""

from __future__ import annotations

from collections.abc import Iterable

from assembly.errors import InputError
from assembly.geometry.faces.face import Face
from assembly.kinematics.body import Body

__all__ = ["check_parameters", "check_size"]

# Sixteen digits are left where products of four are near the ends of what doubles have.
SHORTEST, LONGEST = 1e-60, 1e60
SMALLEST, LARGEST = 1e-75, 1e75


def check_parameters(name: str, faces: Iterable[Face]) -> None:
    """Raise where the parameters of a face are too long or too short to track points by."""
    for face in faces:
        for word, (low, high) in zip("uv", face.surface.domain, strict=True):
            if not SHORTEST <= high - low <= LONGEST:
                raise InputError(
                    f"{name} has a face whose {word} goes from {low:g} to {high:g}; expected knots that span "
                    f"{SHORTEST:g} to {LONGEST:g} for contacts and clearances: choose another unit of length"
                )


def check_size(name: str, body: Body) -> None:
    """Raise where a body is too large or too small to be kept apart from others."""
    check_parameters(name, (side.face for side in body.faces))
    if body.faces and not SMALLEST <= body.size <= LARGEST:
        raise InputError(
            f"{name} has the size {body.size:g}; expected {SMALLEST:g} to {LARGEST:g} for clearances: "
            "choose another unit of length"
        )
