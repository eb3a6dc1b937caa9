"""Control nodes on the mission clock."""
