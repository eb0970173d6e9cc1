"""All rows of a scene as dense matrices, for diagnosis."""
