"""Pairs of features that hand over to each other in a circle: the circle is gone round once, not until all rounds are.

Features are those of a made-up body, of which it is known which one takes over; kernels run as plain Python.
"""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from assembly.proximity.brep.records import EDGE
from assembly.proximity.extrema.face_face import CONVERGED, NOT_CONVERGED
from assembly.proximity.features import switching
from assembly.proximity.features.switching import ROUNDS, track_features

UP = (0.0, 0.0, 1.0)


@pytest.fixture
def followed(monkeypatch):
    """A function: the track along features that take over as told, and how often Newton's method was run."""

    def follow(takes_over):
        solved = []

        def solve(_store, f, _g, _pose, x, n, *_limits):
            solved.append(f.record)
            return CONVERGED, x, SimpleNamespace(normal=n)

        def checked(_store, shell, code, a, b, _held, _n):
            after = takes_over[code] if shell == 0 else code
            return after, (a, b) if shell else (float(after), 0.0), after != code

        monkeypatch.setattr(
            switching, "feature_of", lambda _store, _shell, code: SimpleNamespace(kind=EDGE, record=code)
        )
        monkeypatch.setattr(switching, "solve_features", solve)
        monkeypatch.setattr(switching, "checked", checked)
        pose = SimpleNamespace(rotation=(1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))
        return track_features(None, (0, 1), pose, (0, 100), (0.0, 0.0, 0.0, 0.0), UP, 1.0, 1.0), len(solved)

    return follow


@pytest.mark.parametrize("period", [2, 3, 5, 7])
@pytest.mark.parametrize("before", [0, 1, 4, 9])
def test_circles_end_as_if_all_rounds_were_gone(followed, before, period):
    """At the feature, and after the count of switches, of who does not notice; after a few runs of Newton's method."""
    takes_over = {code: code + 1 for code in range(before + period)}
    takes_over[before + period] = before + 1
    track, runs = followed(takes_over)
    code = 0
    for _ in range(ROUNDS):
        code = takes_over[code]
    assert track.status == NOT_CONVERGED and track.switches == ROUNDS
    assert track.codes == (code, 100) and track.x[0] == float(code)
    assert runs <= 4 * (before + period) + 8


def test_what_arrives_is_left_alone(followed):
    """Forty features one after another are no circle."""
    takes_over = {code: min(code + 1, 40) for code in range(41)}
    track, runs = followed(takes_over)
    assert track.status == CONVERGED and track.codes == (40, 100) and track.switches == 40 and runs == 41
