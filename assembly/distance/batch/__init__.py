"""Collision queries of many shapes at once."""
