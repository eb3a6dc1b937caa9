"""Parsers from YAML nodes to the typed content of mission, library and cell files."""
