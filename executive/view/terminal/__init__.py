"""Views of a run on a terminal: live screen, plain lines, key commands, and summary."""
