"""From constraints to poses: the loop, its options, and what it hands back."""
