"""What measurements found, as text and as plain data."""
