"""Drawings of a behaviour tree: text for a terminal, and SVG picture."""
