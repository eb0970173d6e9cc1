"""Certified distances of posed bodies of trimmed faces: trees of patches that are kept, and a search over their pairs."""
