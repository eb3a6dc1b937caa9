"""Evaluation of detectors: error rates, average precision, position errors, latency, worst mistakes."""
