"""Poses of rigid bodies whose NURBS surfaces touch: constraints hold to 1e-12, with an honest status.

Every name is imported when it is first used, so that a script waits only for what it needs.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from assembly._lazy import lazy_names

__version__ = "0.1.0"

if TYPE_CHECKING:
    from assembly import cad as cad
    from assembly import errors as errors
    from assembly import proximity as proximity
    from assembly import view as view
    from assembly.assembly import Assembly as Assembly
    from assembly.constraints.model.clearance import Clearance as Clearance
    from assembly.constraints.model.contact import Contact as Contact
    from assembly.constraints.model.contact_place import ContactPlace as ContactPlace
    from assembly.constraints.model.couplings import Gear as Gear
    from assembly.constraints.model.couplings import Linear as Linear
    from assembly.constraints.model.couplings import RackPinion as RackPinion
    from assembly.constraints.model.dexterity import Dexterity as Dexterity
    from assembly.constraints.model.expression import Expression as Expression
    from assembly.constraints.model.groups import Group as Group
    from assembly.constraints.model.groups import Symmetric as Symmetric
    from assembly.constraints.model.joints import ConstantVelocity as ConstantVelocity
    from assembly.constraints.model.joints import Cylindrical as Cylindrical
    from assembly.constraints.model.joints import Fixed as Fixed
    from assembly.constraints.model.joints import Parallel as Parallel
    from assembly.constraints.model.joints import Perpendicular as Perpendicular
    from assembly.constraints.model.joints import Planar as Planar
    from assembly.constraints.model.joints import Prismatic as Prismatic
    from assembly.constraints.model.joints import Revolute as Revolute
    from assembly.constraints.model.joints import Screw as Screw
    from assembly.constraints.model.joints import Spherical as Spherical
    from assembly.constraints.model.joints import Universal as Universal
    from assembly.constraints.model.mates import Coaxial as Coaxial
    from assembly.constraints.model.mates import Concentric as Concentric
    from assembly.constraints.model.mates import Flush as Flush
    from assembly.constraints.model.mates import Insert as Insert
    from assembly.constraints.model.mates import Width as Width
    from assembly.constraints.model.objectives import FrameDistance as FrameDistance
    from assembly.constraints.model.objectives import PointDistance as PointDistance
    from assembly.constraints.model.objectives import Posture as Posture
    from assembly.constraints.model.objectives import Weight as Weight
    from assembly.constraints.model.placements import Angle as Angle
    from assembly.constraints.model.placements import Distance as Distance
    from assembly.constraints.model.placements import PointOnLine as PointOnLine
    from assembly.constraints.model.placements import PointOnPlane as PointOnPlane
    from assembly.constraints.model.tangent import Tangent as Tangent
    from assembly.constraints.model.trim_contact import TrimContact as TrimContact
    from assembly.derivatives.implicit import sensitivity as sensitivity
    from assembly.derivatives.measure import Measure as Measure
    from assembly.derivatives.parameter import Parameter as Parameter
    from assembly.derivatives.response import Response as Response
    from assembly.derivatives.response import ResponseError as ResponseError
    from assembly.derivatives.result import Sensitivity as Sensitivity
    from assembly.files.gltf import write_gltf as write_gltf
    from assembly.files.picture_reader import read_picture as read_picture
    from assembly.files.robot import Robot as Robot
    from assembly.files.stl import write_stl as write_stl
    from assembly.files.urdf_reader import read_urdf as read_urdf
    from assembly.files.urdf_writer import write_urdf as write_urdf
    from assembly.geometry import shapes as shapes
    from assembly.geometry.faces.face import Face as Face
    from assembly.geometry.faces.loop import Loop as Loop
    from assembly.geometry.shapes import curves as curves
    from assembly.geometry.splines.curve import NurbsCurve as NurbsCurve
    from assembly.geometry.splines.formula_curve import FormulaCurve as FormulaCurve
    from assembly.geometry.splines.surface import NurbsSurface as NurbsSurface
    from assembly.kinematics.body import Body as Body
    from assembly.kinematics.ellipsoid import Ellipsoid as Ellipsoid
    from assembly.kinematics.parametric import Parametric as Parametric
    from assembly.kinematics.picture_mesh import PictureMesh as PictureMesh
    from assembly.kinematics.pose import Pose as Pose
    from assembly.kinematics.pose import deg as deg
    from assembly.proximity.extrema.pairs import ContactPair as ContactPair
    from assembly.proximity.manager.events import Event as Event
    from assembly.scene_file import load as load
    from assembly.solve.crossings import Crossings as Crossings
    from assembly.solve.diagnosis.mobility import Mobility as Mobility
    from assembly.solve.forces import statics as statics
    from assembly.solve.forces.end_effector import dexterity_ellipsoid as dexterity_ellipsoid
    from assembly.solve.forces.end_effector import dexterity_value as dexterity_value
    from assembly.solve.forces.end_effector import tip_jacobian as tip_jacobian
    from assembly.solve.forces.statics import Wrench as Wrench
    from assembly.solve.oracle import reference as reference
    from assembly.solve.scene import Status as Status
    from assembly.solve.second_order.classification import SecondOrder as SecondOrder
    from assembly.solve.solution import Solution as Solution
    from assembly.solve.way import Way as Way
    from assembly.step import read_brep as read_brep
    from assembly.step import read_iges as read_iges
    from assembly.step import read_step as read_step
    from assembly.step import write_brep as write_brep
    from assembly.step import write_iges as write_iges
    from assembly.step import write_step as write_step
    from assembly.studies.batches.result import Batch as Batch
    from assembly.studies.branches.following import follow as follow
    from assembly.studies.branches.options import FollowOptions as FollowOptions
    from assembly.studies.branches.result import Branch as Branch
    from assembly.studies.branches.result import BranchEvent as BranchEvent
    from assembly.studies.branches.signs import configuration as configuration
    from assembly.studies.fits import Play as Play
    from assembly.studies.fits import play as play
    from assembly.studies.interference.clash import Clash as Clash
    from assembly.studies.interference.clash import Interference as Interference
    from assembly.studies.interference.report import interference as interference
    from assembly.studies.reachable import Workspace as Workspace
    from assembly.studies.reachable import workspace as workspace
    from assembly.studies.sweeps.plans import Plan as Plan
    from assembly.studies.sweeps.plans import grid as grid
    from assembly.studies.sweeps.plans import latin_hypercube as latin_hypercube
    from assembly.studies.sweeps.plans import rows as rows
    from assembly.studies.sweeps.plans import sobol as sobol
    from assembly.studies.sweeps.plans import starts as starts
    from assembly.studies.sweeps.result import Study as Study
    from assembly.studies.sweeps.run_study import study as study
    from assembly.studies.sweeps.scheduling import StudyError as StudyError
    from assembly.studies.synthesis.dimensions import synthesize as synthesize
    from assembly.studies.synthesis.result import Synthesis as Synthesis
    from assembly.studies.synthesis.station import Station as Station
    from assembly.studies.tolerances.distributions import Normal as Normal
    from assembly.studies.tolerances.distributions import Uniform as Uniform
    from assembly.studies.tolerances.result import Tolerances as Tolerances
    from assembly.studies.tolerances.stack import tolerances as tolerances
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
            "Angle": "assembly.constraints.model.placements",
            "Assembly": "assembly.assembly",
            "Body": "assembly.kinematics.body",
            "Branch": "assembly.studies.branches.result",
            "BranchEvent": "assembly.studies.branches.result",
            "Clash": "assembly.studies.interference.clash",
            "Clearance": "assembly.constraints.model.clearance",
            "Coaxial": "assembly.constraints.model.mates",
            "Concentric": "assembly.constraints.model.mates",
            "ConstantVelocity": "assembly.constraints.model.joints",
            "Contact": "assembly.constraints.model.contact",
            "ContactPair": "assembly.proximity.extrema.pairs",
            "Crossings": "assembly.solve.crossings",
            "Cylindrical": "assembly.constraints.model.joints",
            "ContactPlace": "assembly.constraints.model.contact_place",
            "Dexterity": "assembly.constraints.model.dexterity",
            "Distance": "assembly.constraints.model.placements",
            "Ellipsoid": "assembly.kinematics.ellipsoid",
            "Event": "assembly.proximity.manager.events",
            "Expression": "assembly.constraints.model.expression",
            "Face": "assembly.geometry.faces.face",
            "Fixed": "assembly.constraints.model.joints",
            "Flush": "assembly.constraints.model.mates",
            "FollowOptions": "assembly.studies.branches.options",
            "FormulaCurve": "assembly.geometry.splines.formula_curve",
            "FrameDistance": "assembly.constraints.model.objectives",
            "Gear": "assembly.constraints.model.couplings",
            "Group": "assembly.constraints.model.groups",
            "Insert": "assembly.constraints.model.mates",
            "Interference": "assembly.studies.interference.clash",
            "Linear": "assembly.constraints.model.couplings",
            "Loop": "assembly.geometry.faces.loop",
            "Manager": "assembly.tracking.manager",
            "Mobility": "assembly.solve.diagnosis.mobility",
            "Measure": "assembly.derivatives.measure",
            "NurbsCurve": "assembly.geometry.splines.curve",
            "NurbsSurface": "assembly.geometry.splines.surface",
            "Normal": "assembly.studies.tolerances.distributions",
            "Parallel": "assembly.constraints.model.joints",
            "Parameter": "assembly.derivatives.parameter",
            "Parametric": "assembly.kinematics.parametric",
            "Perpendicular": "assembly.constraints.model.joints",
            "Planar": "assembly.constraints.model.joints",
            "Play": "assembly.studies.fits",
            "PointDistance": "assembly.constraints.model.objectives",
            "PointOnLine": "assembly.constraints.model.placements",
            "PointOnPlane": "assembly.constraints.model.placements",
            "PictureMesh": "assembly.kinematics.picture_mesh",
            "Pose": "assembly.kinematics.pose",
            "deg": "assembly.kinematics.pose",
            "Posture": "assembly.constraints.model.objectives",
            "Prismatic": "assembly.constraints.model.joints",
            "RackPinion": "assembly.constraints.model.couplings",
            "Revolute": "assembly.constraints.model.joints",
            "Robot": "assembly.files.robot",
            "Screw": "assembly.constraints.model.joints",
            "SecondOrder": "assembly.solve.second_order.classification",
            "Response": "assembly.derivatives.response",
            "ResponseError": "assembly.derivatives.response",
            "Sensitivity": "assembly.derivatives.result",
            "Solution": "assembly.solve.solution",
            "Spherical": "assembly.constraints.model.joints",
            "Status": "assembly.solve.scene",
            "Step": "assembly.tracking.tick",
            "Symmetric": "assembly.constraints.model.groups",
            "Tangent": "assembly.constraints.model.tangent",
            "Station": "assembly.studies.synthesis.station",
            "Synthesis": "assembly.studies.synthesis.result",
            "Plan": "assembly.studies.sweeps.plans",
            "Study": "assembly.studies.sweeps.result",
            "StudyError": "assembly.studies.sweeps.scheduling",
            "grid": "assembly.studies.sweeps.plans",
            "latin_hypercube": "assembly.studies.sweeps.plans",
            "rows": "assembly.studies.sweeps.plans",
            "sobol": "assembly.studies.sweeps.plans",
            "starts": "assembly.studies.sweeps.plans",
            "study": "assembly.studies.sweeps.run_study",
            "synthesize": "assembly.studies.synthesis.dimensions",
            "Batch": "assembly.studies.batches.result",
            "Tolerances": "assembly.studies.tolerances.result",
            "Trace": "assembly.tracking.trace",
            "TrackLog": "assembly.tracking.log",
            "TrackStatus": "assembly.tracking.tick",
            "Tracker": "assembly.tracking.tracker",
            "TrimContact": "assembly.constraints.model.trim_contact",
            "Uniform": "assembly.studies.tolerances.distributions",
            "Universal": "assembly.constraints.model.joints",
            "Way": "assembly.solve.way",
            "Weight": "assembly.constraints.model.objectives",
            "Width": "assembly.constraints.model.mates",
            "Workspace": "assembly.studies.reachable",
            "Wrench": "assembly.solve.forces.statics",
            "cad": "assembly.cad",
            "configuration": "assembly.studies.branches.signs",
            "curves": "assembly.geometry.shapes.curves",
            "dexterity_ellipsoid": "assembly.solve.forces.end_effector",
            "dexterity_value": "assembly.solve.forces.end_effector",
            "errors": "assembly.errors",
            "follow": "assembly.studies.branches.following",
            "interference": "assembly.studies.interference.report",
            "load": "assembly.scene_file",
            "play": "assembly.studies.fits",
            "proximity": "assembly.proximity",
            "read_brep": "assembly.step",
            "read_iges": "assembly.step",
            "read_step": "assembly.step",
            "read_picture": "assembly.files.picture_reader",
            "read_urdf": "assembly.files.urdf_reader",
            "reference": "assembly.solve.oracle.reference",
            "sensitivity": "assembly.derivatives.implicit",
            "shapes": "assembly.geometry.shapes",
            "statics": "assembly.solve.forces.statics",
            "tolerances": "assembly.studies.tolerances.stack",
            "tip_jacobian": "assembly.solve.forces.end_effector",
            "view": "assembly.view",
            "workspace": "assembly.studies.reachable",
            "write_brep": "assembly.step",
            "write_gltf": "assembly.files.gltf",
            "write_iges": "assembly.step",
            "write_step": "assembly.step",
            "write_stl": "assembly.files.stl",
            "write_urdf": "assembly.files.urdf_writer",
        },
    )
