"""Many runs: sweeps over seeds."""
