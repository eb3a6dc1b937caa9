"""What a run leaves behind: observers of its events."""
