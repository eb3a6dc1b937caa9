"""Detectors, which find objects in frames in parallel with the control loop."""
