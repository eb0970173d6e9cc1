"""Pairs of wires by their centerlines."""
