"""Results of many runs: rows per run, item and phase, the database that stores the rows, and statistics."""
