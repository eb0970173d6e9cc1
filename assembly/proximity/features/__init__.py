"""The nearest features of two solids: global search, and tracking over faces, edges and vertices."""
