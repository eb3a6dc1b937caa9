"""The skills this project ships, one class per file."""
