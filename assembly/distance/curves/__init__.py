"""Distances of Bezier curves by best-first branch and bound."""
