"""Which bodies of a scene are near each other or cross: a row a pair, with what is proven of it."""
