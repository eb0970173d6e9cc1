"""Factorization and singular values."""
