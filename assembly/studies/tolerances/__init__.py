"""Tolerances: effects of scatter of dimensions on measures of an assembly."""
