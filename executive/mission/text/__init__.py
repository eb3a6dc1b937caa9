"""Files and their YAML text, with the places of all values."""
