"""B-rep bodies: faces, boundary curves, vertices, and how they are packed for kernels."""
