"""Kinds of cells: the simulated one, and the fake one for tests."""
