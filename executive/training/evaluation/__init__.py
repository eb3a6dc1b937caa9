"""How good a detector is: what it finds, what it imagines, how far off its boxes are, how long it takes."""
