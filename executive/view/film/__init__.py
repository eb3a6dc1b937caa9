"""Films of recorded runs: what the world looked like, and what the tree decided meanwhile."""
