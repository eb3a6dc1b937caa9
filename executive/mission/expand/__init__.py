"""Expansion of the subtrees, params and arguments of a mission."""
