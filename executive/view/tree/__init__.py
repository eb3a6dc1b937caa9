"""Representations of a tree: text, SVG, Graphviz."""
