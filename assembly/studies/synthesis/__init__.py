"""Dimensions of a mechanism that are found for what it is to do."""
