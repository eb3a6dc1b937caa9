"""Functions that several skills use: loops of looks and motions, goals of the tool, obstacles."""
