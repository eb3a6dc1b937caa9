"""Motion planning of the arm: kinematics, obstacles, search, optimization, payload limits and braking."""
