"""Results of measurements, as text and as JSON values."""
