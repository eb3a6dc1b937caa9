"""Typed content of missions: grammar, nodes, values and connections."""
