"""The public test kit for skills and missions."""
