"""Closest-point controllers (paper 000): feedback laws that converge from anywhere, and their gains."""
