"""Kinematics, limits, trajectories and braking of the arm; no simulator."""
