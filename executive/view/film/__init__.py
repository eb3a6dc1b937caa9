"""Films of recorded runs: the world, and the decisions of the tree."""
