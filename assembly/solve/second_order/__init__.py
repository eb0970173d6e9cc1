"""What a stationary point is, and how a saddle is left."""
