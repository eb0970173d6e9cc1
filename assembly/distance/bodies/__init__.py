"""Certified distances of posed bodies: trees of patches that are kept with the shapes, a search over pairs of nodes."""
