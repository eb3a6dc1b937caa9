"""Execution of a run: assembly, tick loop, control, operator, resumption and end."""
