"""Everything that can be known to be wrong before anything moves; one file per subject."""
