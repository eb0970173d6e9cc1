"""Kernels that evaluate constraint residuals, their derivatives, and objective terms from the packed table."""
