"""Drivers of cells: devices only, without planner, ledger and detectors."""
