"""Following a hand: recorded motions, trackers, logs, and the forces that a hand feels."""
