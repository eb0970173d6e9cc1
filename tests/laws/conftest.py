from __future__ import annotations

import pytest

from tests.laws.scenes import random_group

# f and g: bicubic, rational and skewed; degrees 4 and 5; tori and ellipsoids.
KINDS = (
    ("dome", "dome"),
    ("dome", "quadratic"),
    ("quadratic", "dome"),
    ("quadratic", "quadratic"),
    ("high", "quadratic"),
)


@pytest.fixture(scope="session", params=range(len(KINDS)), ids=["-".join(kinds) for kinds in KINDS])
def group(request, cases):
    """Random pairs; with ``--long`` 200, 1,000 over all parameters."""
    return random_group(20 + request.param, *KINDS[request.param], cases(50, 200))
