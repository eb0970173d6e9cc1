"""How much is tried: ``--long`` tries a hundred times as much."""

from __future__ import annotations

import pytest


@pytest.fixture(scope="session")
def times(request) -> int:
    """Factor of the number of random cases."""
    return 100 if request.config.getoption("--long") else 1
