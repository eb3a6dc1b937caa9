"""A behaviour-tree task executive for vision-guided pick and place."""
