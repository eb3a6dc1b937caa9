"""What a person watches while a mission runs."""
