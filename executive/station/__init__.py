"""What is built above the devices of a cell: planner service, camera, ledger, detectors."""
