"""Detectors: who finds objects in a frame, beside the tick loop."""
