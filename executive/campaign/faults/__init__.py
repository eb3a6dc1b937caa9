"""Fault campaigns: runs of a mission with all possible faults, singly and in pairs."""
