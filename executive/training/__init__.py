"""Datasets, training of the small RF-DETR (needs the extra `train`), and evaluation of detectors."""
