"""Skills of this project, one class per file."""
