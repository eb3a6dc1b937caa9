"""Several detectors about the same frame: what they say together, or nothing where they disagree."""
