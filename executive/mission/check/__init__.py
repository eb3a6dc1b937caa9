"""Checks that find errors in a mission before it runs; one module per subject."""
