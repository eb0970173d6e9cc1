"""The contact manager: which pairs of bodies are near, and which extrema of theirs are tracked."""
