"""Functions that skills share: tool goals, motions, obstacles, drops."""
