"""Files, their text, and where things stand in it."""
