"""The page that explains a finished run: one HTML file that needs nothing else."""
