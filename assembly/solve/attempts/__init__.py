"""Solves from more than one start: the loop again where it did not end solved."""
