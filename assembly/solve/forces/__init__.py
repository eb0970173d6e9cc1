"""Forces of a solution: statics, and what an end effector can do."""
