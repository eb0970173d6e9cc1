"""What a scene can do and why it cannot: mobility, redundancy, conflicts, unbounded objectives, bounds of the pose
error.
"""
