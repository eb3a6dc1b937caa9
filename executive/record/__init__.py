"""Record of a run: observers of its events, run directory, result, replay and resumption."""
