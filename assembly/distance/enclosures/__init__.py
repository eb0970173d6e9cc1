"""Bounding bodies of pieces of curves and surfaces, and the search over pairs of them."""
