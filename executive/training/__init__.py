"""Training of the small RF-DETR: everything here needs the `train` extra and is imported only by it."""
