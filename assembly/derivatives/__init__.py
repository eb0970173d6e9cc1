"""Numbers of a scene that may be set anew, and how a solution changes with them; docs/sensitivity.md."""
