"""Where two shapes are closest, how sure we are, and how that moves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from assembly._lazy import lazy_names

if TYPE_CHECKING:
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
    from assembly.proximity.pairs import extremal_pair as extremal_pair
    from assembly.proximity.pairs import gap_gradient as gap_gradient
    from assembly.proximity.pairs import gap_hessian as gap_hessian
else:
    __getattr__, __dir__, __all__ = lazy_names(
        __name__,
        {
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
            "extremal_pair": "assembly.proximity.pairs",
            "gap_gradient": "assembly.proximity.pairs",
            "gap_hessian": "assembly.proximity.pairs",
        },
    )
