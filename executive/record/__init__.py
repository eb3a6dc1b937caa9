"""Record of a run: run directory, journal, pictures, result and diagnosis; replay and resumption."""
