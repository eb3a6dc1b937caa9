"""Driver of the simulated cell."""
