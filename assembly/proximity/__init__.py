"""Where two shapes are closest, how sure we are, and how that moves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from assembly._lazy import lazy_names

if TYPE_CHECKING:
    from assembly.proximity.collision_queries import collisions as collisions
    from assembly.proximity.control import Controller as Controller
    from assembly.proximity.control import ControlRun as ControlRun
    from assembly.proximity.control import ControlStatus as ControlStatus
    from assembly.proximity.control_bounds import GainBounds as GainBounds
    from assembly.proximity.control_bounds import Hypotheses as Hypotheses
    from assembly.proximity.control_bounds import convergence_hypotheses as convergence_hypotheses
    from assembly.proximity.control_bounds import gain_bounds as gain_bounds
    from assembly.proximity.control_bounds import gain_limit as gain_limit
    from assembly.proximity.control_bounds import is_globally_convergent as is_globally_convergent
    from assembly.proximity.curve_pairs import CurvePair as CurvePair
    from assembly.proximity.curve_pairs import curve_contact_jacobian as curve_contact_jacobian
    from assembly.proximity.curve_pairs import curve_gap_gradient as curve_gap_gradient
    from assembly.proximity.curve_pairs import curve_gap_hessian as curve_gap_hessian
    from assembly.proximity.curve_pairs import extremal_curve_pair as extremal_curve_pair
    from assembly.proximity.features import Feature as Feature
    from assembly.proximity.features import FeaturePair as FeaturePair
    from assembly.proximity.features import FeatureStatus as FeatureStatus
    from assembly.proximity.features import FeatureTracker as FeatureTracker
    from assembly.proximity.features import closest_features as closest_features
    from assembly.proximity.pairs import ContactPair as ContactPair
    from assembly.proximity.pairs import PairStatus as PairStatus
    from assembly.proximity.pairs import contact_jacobian as contact_jacobian
    from assembly.proximity.pairs import descend as descend
    from assembly.proximity.pairs import extremal_pair as extremal_pair
    from assembly.proximity.pairs import gap_gradient as gap_gradient
    from assembly.proximity.pairs import gap_hessian as gap_hessian
    from assembly.proximity.piece_enclosure import Enclosure as Enclosure
    from assembly.proximity.piece_enclosure import enclosure as enclosure
    from assembly.proximity.queries import closest_points as closest_points
    from assembly.proximity.queries import collides as collides
    from assembly.proximity.queries import is_separated as is_separated
    from assembly.proximity.queries import minimum_distance as minimum_distance
    from assembly.proximity.queries import minimum_distances as minimum_distances
    from assembly.proximity.separation import Separation as Separation
    from assembly.proximity.separation import SeparationStatus as SeparationStatus
else:
    __getattr__, __dir__, __all__ = lazy_names(
        __name__,
        {
            "collisions": "assembly.proximity.collision_queries",
            "Enclosure": "assembly.proximity.piece_enclosure",
            "enclosure": "assembly.proximity.piece_enclosure",
            "ControlRun": "assembly.proximity.control",
            "ControlStatus": "assembly.proximity.control",
            "Controller": "assembly.proximity.control",
            "GainBounds": "assembly.proximity.control_bounds",
            "Hypotheses": "assembly.proximity.control_bounds",
            "convergence_hypotheses": "assembly.proximity.control_bounds",
            "gain_bounds": "assembly.proximity.control_bounds",
            "gain_limit": "assembly.proximity.control_bounds",
            "is_globally_convergent": "assembly.proximity.control_bounds",
            "CurvePair": "assembly.proximity.curve_pairs",
            "curve_contact_jacobian": "assembly.proximity.curve_pairs",
            "curve_gap_gradient": "assembly.proximity.curve_pairs",
            "curve_gap_hessian": "assembly.proximity.curve_pairs",
            "extremal_curve_pair": "assembly.proximity.curve_pairs",
            "Feature": "assembly.proximity.features",
            "FeaturePair": "assembly.proximity.features",
            "FeatureStatus": "assembly.proximity.features",
            "FeatureTracker": "assembly.proximity.features",
            "closest_features": "assembly.proximity.features",
            "ContactPair": "assembly.proximity.pairs",
            "PairStatus": "assembly.proximity.pairs",
            "contact_jacobian": "assembly.proximity.pairs",
            "descend": "assembly.proximity.pairs",
            "extremal_pair": "assembly.proximity.pairs",
            "gap_gradient": "assembly.proximity.pairs",
            "gap_hessian": "assembly.proximity.pairs",
            "closest_points": "assembly.proximity.queries",
            "collides": "assembly.proximity.queries",
            "is_separated": "assembly.proximity.queries",
            "minimum_distance": "assembly.proximity.queries",
            "minimum_distances": "assembly.proximity.queries",
            "Separation": "assembly.proximity.separation",
            "SeparationStatus": "assembly.proximity.separation",
        },
    )
