"""Drawings of a behaviour tree: text for a terminal, SVG picture, and Graphviz text."""
