"""Views of a tree: text, picture and Graphviz text."""
