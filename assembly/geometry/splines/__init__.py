"""NURBS curves and surfaces: evaluation, Bezier pieces, bounds of derivatives."""
