"""The tick loop, the person beside the cell, and the installed kinds of cells."""
