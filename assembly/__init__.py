"""Poses of rigid bodies whose NURBS surfaces touch, found to 1e-12 with an honest status.

Every name is imported when it is first used, so that a script waits only for what it needs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from assembly._lazy import lazy_names

__version__ = "0.1.0"

if TYPE_CHECKING:
    from assembly import errors as errors
    from assembly import proximity as proximity
    from assembly import view as view
    from assembly.assembly import Assembly as Assembly
    from assembly.constraints.contact import Contact as Contact
    from assembly.constraints.objectives import PointDistance as PointDistance
    from assembly.constraints.objectives import Posture as Posture
    from assembly.geometry import shapes as shapes
    from assembly.geometry.curve import NurbsCurve as NurbsCurve
    from assembly.geometry.face import Face as Face
    from assembly.geometry.surface import NurbsSurface as NurbsSurface
    from assembly.kinematics.body import Body as Body
    from assembly.kinematics.pose import Pose as Pose
    from assembly.proximity.pairs import ContactPair as ContactPair
    from assembly.scene_file import load as load
    from assembly.solve import reference as reference
    from assembly.solve.solution import Solution as Solution
    from assembly.solve.solution import Status as Status
else:
    __getattr__, __dir__, __all__ = lazy_names(
        __name__,
        {
            "Assembly": "assembly.assembly",
            "Body": "assembly.kinematics.body",
            "Contact": "assembly.constraints.contact",
            "ContactPair": "assembly.proximity.pairs",
            "Face": "assembly.geometry.face",
            "NurbsCurve": "assembly.geometry.curve",
            "NurbsSurface": "assembly.geometry.surface",
            "PointDistance": "assembly.constraints.objectives",
            "Pose": "assembly.kinematics.pose",
            "Posture": "assembly.constraints.objectives",
            "Solution": "assembly.solve.solution",
            "Status": "assembly.solve.solution",
            "errors": "assembly.errors",
            "load": "assembly.scene_file",
            "proximity": "assembly.proximity",
            "reference": "assembly.solve.reference",
            "shapes": "assembly.geometry.shapes",
            "view": "assembly.view",
        },
    )
