"""All rows of a scene as dense matrices: what looks at a pose and does not solve."""
