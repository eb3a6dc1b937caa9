"""Parsers from YAML nodes to the typed model, with findings for malformed input."""
