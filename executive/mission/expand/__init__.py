"""Subtrees, params and arguments put in the places where they are used."""
