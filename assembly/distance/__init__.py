"""Certified distances of curves, surfaces and hulls (paper 003): bounds that hold, whatever the rounding."""
