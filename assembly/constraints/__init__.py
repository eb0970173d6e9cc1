"""Constraints between bodies, and objectives."""
