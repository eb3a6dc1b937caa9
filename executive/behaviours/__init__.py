"""Behaviours of py_trees as skills, each run with a blackboard of py_trees of its own."""
