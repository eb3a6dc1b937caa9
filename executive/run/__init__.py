"""Assembly, tick loop, control and end of a run, and its operator."""
