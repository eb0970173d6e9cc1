"""Where a region of a face is cut into pieces along the seams of its surface."""
