"""JSON Schema of mission, library and cell files."""
