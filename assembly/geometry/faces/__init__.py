"""Trimmed faces: loops of curves in the parameter plane, what is inside them, and how large they are."""
