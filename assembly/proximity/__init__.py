"""Nearest and extremal points of shapes, with certificates, and their motion."""

from __future__ import annotations

from typing import TYPE_CHECKING

from assembly._lazy import lazy_names

if TYPE_CHECKING:
    from assembly.distance.batch.queries import collisions as collisions
    from assembly.distance.enclosures.piece_enclosure import Enclosure as Enclosure
    from assembly.distance.enclosures.piece_enclosure import enclosure as enclosure
    from assembly.distance.queries import closest_points as closest_points
    from assembly.distance.queries import collides as collides
    from assembly.distance.queries import is_separated as is_separated
    from assembly.distance.queries import minimum_distance as minimum_distance
    from assembly.distance.queries import minimum_distances as minimum_distances
    from assembly.distance.separation import Separation as Separation
    from assembly.distance.separation import SeparationStatus as SeparationStatus
    from assembly.proximity.controllers.bounds import GainBounds as GainBounds
    from assembly.proximity.controllers.bounds import Hypotheses as Hypotheses
    from assembly.proximity.controllers.bounds import convergence_hypotheses as convergence_hypotheses
    from assembly.proximity.controllers.bounds import gain_bounds as gain_bounds
    from assembly.proximity.controllers.bounds import gain_limit as gain_limit
    from assembly.proximity.controllers.bounds import is_globally_convergent as is_globally_convergent
    from assembly.proximity.controllers.control import Controller as Controller
    from assembly.proximity.controllers.control import ControlRun as ControlRun
    from assembly.proximity.controllers.control import ControlStatus as ControlStatus
    from assembly.proximity.extrema.curve_curve import CurvePair as CurvePair
    from assembly.proximity.extrema.curve_curve import curve_contact_jacobian as curve_contact_jacobian
    from assembly.proximity.extrema.curve_curve import curve_gap_gradient as curve_gap_gradient
    from assembly.proximity.extrema.curve_curve import curve_gap_hessian as curve_gap_hessian
    from assembly.proximity.extrema.curve_curve import extremal_curve_pair as extremal_curve_pair
    from assembly.proximity.extrema.pairs import ContactPair as ContactPair
    from assembly.proximity.extrema.pairs import PairStatus as PairStatus
    from assembly.proximity.extrema.pairs import contact_jacobian as contact_jacobian
    from assembly.proximity.extrema.pairs import descend as descend
    from assembly.proximity.extrema.pairs import extremal_pair as extremal_pair
    from assembly.proximity.extrema.pairs import gap_gradient as gap_gradient
    from assembly.proximity.extrema.pairs import gap_hessian as gap_hessian
    from assembly.proximity.features.body_distance import BodyDistance as BodyDistance
    from assembly.proximity.features.body_distance import DistanceStatus as DistanceStatus
    from assembly.proximity.features.body_distance import distance as distance
    from assembly.proximity.features.features import Feature as Feature
    from assembly.proximity.features.features import FeaturePair as FeaturePair
    from assembly.proximity.features.features import FeatureStatus as FeatureStatus
    from assembly.proximity.features.features import FeatureTracker as FeatureTracker
    from assembly.proximity.features.features import closest_features as closest_features
    from assembly.proximity.manifolds.query import ContactManifold as ContactManifold
    from assembly.proximity.manifolds.query import contact_manifold as contact_manifold
else:
    __getattr__, __dir__, __all__ = lazy_names(
        __name__,
        {
            "collisions": "assembly.distance.batch.queries",
            "Enclosure": "assembly.distance.enclosures.piece_enclosure",
            "enclosure": "assembly.distance.enclosures.piece_enclosure",
            "ControlRun": "assembly.proximity.controllers.control",
            "ControlStatus": "assembly.proximity.controllers.control",
            "Controller": "assembly.proximity.controllers.control",
            "ContactManifold": "assembly.proximity.manifolds.query",
            "contact_manifold": "assembly.proximity.manifolds.query",
            "GainBounds": "assembly.proximity.controllers.bounds",
            "Hypotheses": "assembly.proximity.controllers.bounds",
            "convergence_hypotheses": "assembly.proximity.controllers.bounds",
            "gain_bounds": "assembly.proximity.controllers.bounds",
            "gain_limit": "assembly.proximity.controllers.bounds",
            "is_globally_convergent": "assembly.proximity.controllers.bounds",
            "CurvePair": "assembly.proximity.extrema.curve_curve",
            "curve_contact_jacobian": "assembly.proximity.extrema.curve_curve",
            "curve_gap_gradient": "assembly.proximity.extrema.curve_curve",
            "curve_gap_hessian": "assembly.proximity.extrema.curve_curve",
            "extremal_curve_pair": "assembly.proximity.extrema.curve_curve",
            "BodyDistance": "assembly.proximity.features.body_distance",
            "DistanceStatus": "assembly.proximity.features.body_distance",
            "distance": "assembly.proximity.features.body_distance",
            "Feature": "assembly.proximity.features.features",
            "FeaturePair": "assembly.proximity.features.features",
            "FeatureStatus": "assembly.proximity.features.features",
            "FeatureTracker": "assembly.proximity.features.features",
            "closest_features": "assembly.proximity.features.features",
            "ContactPair": "assembly.proximity.extrema.pairs",
            "PairStatus": "assembly.proximity.extrema.pairs",
            "contact_jacobian": "assembly.proximity.extrema.pairs",
            "descend": "assembly.proximity.extrema.pairs",
            "extremal_pair": "assembly.proximity.extrema.pairs",
            "gap_gradient": "assembly.proximity.extrema.pairs",
            "gap_hessian": "assembly.proximity.extrema.pairs",
            "closest_points": "assembly.distance.queries",
            "collides": "assembly.distance.queries",
            "is_separated": "assembly.distance.queries",
            "minimum_distance": "assembly.distance.queries",
            "minimum_distances": "assembly.distance.queries",
            "Separation": "assembly.distance.separation",
            "SeparationStatus": "assembly.distance.separation",
        },
    )
