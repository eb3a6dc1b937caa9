"""Command line: parses options, calls the packages, and prints results."""
