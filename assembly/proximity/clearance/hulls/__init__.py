"""Whether bodies are clear or only touch, told by convex hulls of whole faces: no cell is made for it."""
