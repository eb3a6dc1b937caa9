"""Films of recorded runs: the simulated world, and the decisions of the tree."""
