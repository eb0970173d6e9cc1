"""Many solves of one scene: several starts, sweeps."""
