"""Control nodes on the mission clock, skills as leaves, variables and halting."""
