"""Which bodies of a scene are near each other or cross: one row per pair, with what is proven of it."""
