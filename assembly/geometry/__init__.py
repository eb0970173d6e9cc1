"""Shapes in body coordinates: curves, surfaces, faces and makers of common shapes."""
