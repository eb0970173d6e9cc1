"""Proofs that bodies are clear or only touch, by convex hulls of whole faces, without cells."""
