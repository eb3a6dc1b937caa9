"""Results of measurements, as text and as plain data."""
