"""Skills of this project, one class per file; conditions, and skills that only handle items, share files."""
