"""Measured envelope of a detector: the conditions under which its error rates were measured."""
