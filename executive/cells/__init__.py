"""Kinds of cells: the simulated cell, and the fake cell for tests."""
