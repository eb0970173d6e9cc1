"""Following a hand: what it did, what a scene did about it, and the forces it feels."""
