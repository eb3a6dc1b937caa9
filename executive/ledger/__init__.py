"""Identity, position and final state of every object on the table."""
