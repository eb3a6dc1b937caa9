"""Texts of files: sources with positions, findings, YAML trees, and their validation."""
