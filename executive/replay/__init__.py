"""What a cell answered in a run: written down as it happens, and played back without the cell."""
