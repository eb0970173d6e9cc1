"""Branches of solutions: followed through turning points, and told apart by their configurations; docs/branches.md."""
