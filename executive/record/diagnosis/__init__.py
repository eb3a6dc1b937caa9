"""Diagnosis of a run that did not succeed, from its timeline."""
