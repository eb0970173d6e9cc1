"""Play: the range of a measure while parts move within their fits."""

from __future__ import annotations

from assembly.studies.fits.range_of_measure import play
from assembly.studies.fits.result import End, Play

__all__ = ["End", "Play", "play"]
