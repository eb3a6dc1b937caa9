"""Series of runs: sweeps over seeds, fault campaigns, and the evaluation of detectors."""
