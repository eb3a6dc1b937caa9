"""Camera model, localization, detectors, and checks of cameras and detections."""
