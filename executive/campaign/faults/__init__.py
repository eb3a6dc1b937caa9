"""Fault campaigns: everything that can go wrong in a mission, one thing at a time, and in pairs."""
