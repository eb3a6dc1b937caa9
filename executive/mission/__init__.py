"""From YAML text to a checked py_trees tree."""
