"""What must hold between bodies, and what is wished for."""
