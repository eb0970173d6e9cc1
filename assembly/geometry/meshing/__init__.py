"""Triangles and polygons of faces, with a bound of their distance from the surface."""
