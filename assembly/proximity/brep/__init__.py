"""Solids and shells: faces, boundary curves, vertices, and how they are packed for kernels."""
