"""A tree, seen: as text, as a picture, as Graphviz."""
