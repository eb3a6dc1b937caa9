"""Results of many runs: rows per run, item and skill, the database that stores the rows, and statistics."""
