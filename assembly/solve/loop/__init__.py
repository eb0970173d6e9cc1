"""The augmented Lagrangian (paper 001) and its phases."""
