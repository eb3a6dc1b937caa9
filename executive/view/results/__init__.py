"""Results of fault campaigns, detector evaluations and conformance checks, as text and as JSON values."""
