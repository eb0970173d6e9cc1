"""Play: how far a measure goes while parts move within the fits that are left to them."""

from __future__ import annotations

from assembly.studies.fits.range_of_measure import play
from assembly.studies.fits.result import End, Play

__all__ = ["End", "Play", "play"]
