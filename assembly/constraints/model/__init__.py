"""Constraints, joints, contacts and objectives as a user writes them."""
