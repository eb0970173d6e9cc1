"""A scene's constraints written into the flat table that kernels read."""
