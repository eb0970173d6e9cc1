"""Synthesis: dimensions with which a mechanism does what is wanted."""
