"""Bodies in the world: poses, and how they move."""
