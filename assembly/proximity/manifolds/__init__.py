"""Contact manifolds: where two conforming faces are nearest, as few rows and a bound."""
