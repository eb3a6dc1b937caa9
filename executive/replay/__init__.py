"""Recording of the inputs of a run, and their replay without the cell."""
