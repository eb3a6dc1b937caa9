"""Timeline of a run: state and history of nodes and items, computed from the events."""
