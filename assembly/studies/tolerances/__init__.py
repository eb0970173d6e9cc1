"""What tolerances of dimensions do to measures of an assembly."""
