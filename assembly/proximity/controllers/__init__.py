"""Closest-point controllers (paper 001, section 4): feedback laws that converge from anywhere, and their gains."""
