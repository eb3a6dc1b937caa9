"""Search for files, and parsing of their YAML text to nodes with positions."""
