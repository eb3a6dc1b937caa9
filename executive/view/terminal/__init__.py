"""A run on a terminal: the live screen, plain lines, keys, and the last words."""
