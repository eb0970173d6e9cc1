"""Measured figures: ``python -m benchmarks`` writes all that README and docs quote."""
