"""Faces, edges and vertices of a body, selected by what they are."""
