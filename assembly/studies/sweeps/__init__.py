"""Studies: thousands of solves, planned, cut into runs, spread over workers, stored and resumed."""
