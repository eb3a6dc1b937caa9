"""Several detectors in order: the next one where the first gives no answer, the first again once it does."""
