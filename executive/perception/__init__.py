"""Camera model, localization, detectors, dataset, training, evaluation."""
