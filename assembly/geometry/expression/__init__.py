"""Expressions of coordinates as tapes of instructions, with derivatives and interval bounds."""
