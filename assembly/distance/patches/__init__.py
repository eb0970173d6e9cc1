"""Distances of Bezier patches and of curves given by formulas."""
