"""Poses of rigid bodies whose NURBS surfaces touch: constraints hold to 1e-12, with an honest status.

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
    from assembly.constraints.clearance import Clearance as Clearance
    from assembly.constraints.contact import Contact as Contact
    from assembly.constraints.couplings import Gear as Gear
    from assembly.constraints.couplings import RackPinion as RackPinion
    from assembly.constraints.dexterity import Dexterity as Dexterity
    from assembly.constraints.expression import Expression as Expression
    from assembly.constraints.joints import Cylindrical as Cylindrical
    from assembly.constraints.joints import Fixed as Fixed
    from assembly.constraints.joints import Parallel as Parallel
    from assembly.constraints.joints import Perpendicular as Perpendicular
    from assembly.constraints.joints import Planar as Planar
    from assembly.constraints.joints import Prismatic as Prismatic
    from assembly.constraints.joints import Revolute as Revolute
    from assembly.constraints.joints import Screw as Screw
    from assembly.constraints.joints import Spherical as Spherical
    from assembly.constraints.joints import Universal as Universal
    from assembly.constraints.objectives import FrameDistance as FrameDistance
    from assembly.constraints.objectives import PointDistance as PointDistance
    from assembly.constraints.objectives import Posture as Posture
    from assembly.constraints.placements import Angle as Angle
    from assembly.constraints.placements import Distance as Distance
    from assembly.constraints.placements import PointOnLine as PointOnLine
    from assembly.constraints.placements import PointOnPlane as PointOnPlane
    from assembly.constraints.trim_contact import TrimContact as TrimContact
    from assembly.geometry import curves as curves
    from assembly.geometry import shapes as shapes
    from assembly.geometry.curve import NurbsCurve as NurbsCurve
    from assembly.geometry.face import Face as Face
    from assembly.geometry.formula_curve import FormulaCurve as FormulaCurve
    from assembly.geometry.loop import Loop as Loop
    from assembly.geometry.surface import NurbsSurface as NurbsSurface
    from assembly.kinematics.body import Body as Body
    from assembly.kinematics.ellipsoid import Ellipsoid as Ellipsoid
    from assembly.kinematics.pose import Pose as Pose
    from assembly.proximity.events import Event as Event
    from assembly.proximity.pairs import ContactPair as ContactPair
    from assembly.scene_file import load as load
    from assembly.solve import reference as reference
    from assembly.solve import statics as statics
    from assembly.solve.crossings import Crossings as Crossings
    from assembly.solve.mobility import Mobility as Mobility
    from assembly.solve.scene import Status as Status
    from assembly.solve.second_order import SecondOrder as SecondOrder
    from assembly.solve.solution import Solution as Solution
    from assembly.solve.statics import Wrench as Wrench
    from assembly.solve.tip import dexterity_ellipsoid as dexterity_ellipsoid
    from assembly.solve.tip import dexterity_value as dexterity_value
    from assembly.solve.tip import tip_jacobian as tip_jacobian
    from assembly.step import read_step as read_step
    from assembly.step import write_step as write_step
    from assembly.tracking.log import TrackLog as TrackLog
    from assembly.tracking.manager import Manager as Manager
    from assembly.tracking.tick import Step as Step
    from assembly.tracking.tick import TrackStatus as TrackStatus
    from assembly.tracking.trace import Trace as Trace
    from assembly.tracking.tracker import Tracker as Tracker
else:
    __getattr__, __dir__, __all__ = lazy_names(
        __name__,
        {
            "Angle": "assembly.constraints.placements",
            "Assembly": "assembly.assembly",
            "Body": "assembly.kinematics.body",
            "Clearance": "assembly.constraints.clearance",
            "Contact": "assembly.constraints.contact",
            "ContactPair": "assembly.proximity.pairs",
            "Crossings": "assembly.solve.crossings",
            "Cylindrical": "assembly.constraints.joints",
            "Dexterity": "assembly.constraints.dexterity",
            "Distance": "assembly.constraints.placements",
            "Ellipsoid": "assembly.kinematics.ellipsoid",
            "Event": "assembly.proximity.events",
            "Expression": "assembly.constraints.expression",
            "Face": "assembly.geometry.face",
            "Fixed": "assembly.constraints.joints",
            "FormulaCurve": "assembly.geometry.formula_curve",
            "FrameDistance": "assembly.constraints.objectives",
            "Gear": "assembly.constraints.couplings",
            "Loop": "assembly.geometry.loop",
            "Manager": "assembly.tracking.manager",
            "Mobility": "assembly.solve.mobility",
            "NurbsCurve": "assembly.geometry.curve",
            "NurbsSurface": "assembly.geometry.surface",
            "Parallel": "assembly.constraints.joints",
            "Perpendicular": "assembly.constraints.joints",
            "Planar": "assembly.constraints.joints",
            "PointDistance": "assembly.constraints.objectives",
            "PointOnLine": "assembly.constraints.placements",
            "PointOnPlane": "assembly.constraints.placements",
            "Pose": "assembly.kinematics.pose",
            "Posture": "assembly.constraints.objectives",
            "Prismatic": "assembly.constraints.joints",
            "RackPinion": "assembly.constraints.couplings",
            "Revolute": "assembly.constraints.joints",
            "Screw": "assembly.constraints.joints",
            "SecondOrder": "assembly.solve.second_order",
            "Solution": "assembly.solve.solution",
            "Spherical": "assembly.constraints.joints",
            "Status": "assembly.solve.scene",
            "Step": "assembly.tracking.tick",
            "Trace": "assembly.tracking.trace",
            "TrackLog": "assembly.tracking.log",
            "TrackStatus": "assembly.tracking.tick",
            "Tracker": "assembly.tracking.tracker",
            "TrimContact": "assembly.constraints.trim_contact",
            "Universal": "assembly.constraints.joints",
            "Wrench": "assembly.solve.statics",
            "curves": "assembly.geometry.curves",
            "dexterity_ellipsoid": "assembly.solve.tip",
            "dexterity_value": "assembly.solve.tip",
            "errors": "assembly.errors",
            "load": "assembly.scene_file",
            "proximity": "assembly.proximity",
            "read_step": "assembly.step",
            "reference": "assembly.solve.reference",
            "shapes": "assembly.geometry.shapes",
            "statics": "assembly.solve.statics",
            "tip_jacobian": "assembly.solve.tip",
            "view": "assembly.view",
            "write_step": "assembly.step",
        },
    )
