"""From constraints to poses: the loop, its options and its results."""
