"""Views of a run on a terminal: live screen, plain lines, keys, and summary."""
