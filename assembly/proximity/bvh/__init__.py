"""Trees of boxes over the facets of surfaces."""
