"""Protocols and values that skills and the run use; the typed cell file; layout; shapes for display."""
