"""Execution of the jobs of a sweep by the workers of a dask scheduler."""
