"""Proofs that two bodies are clear of each other, touch, cross, or that one is within the other."""
