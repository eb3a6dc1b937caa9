"""Functions that several skills use: tool goals, motions, obstacles, and detection of drops."""
