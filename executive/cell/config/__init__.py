"""Typed content of a cell file: robot, tool, cameras, table, bins, objects and detectors.

Each field is a key of `missions/cells/*.yaml`, in SI units. Values of keys that end in `_deg` are in degrees.
"""

from __future__ import annotations

from executive.cell.config.arm import ArmConfig, LimitsConfig, MotionConfig, ToolConfig
from executive.cell.config.calibration import CalibrationConfig
from executive.cell.config.cameras import CameraConfig, DepthConfig, NoiseConfig
from executive.cell.config.cell import CellConfig, DetectorConfig, LedgerConfig
from executive.cell.config.objects import BinConfig, ObjectConfig, TableConfig
from executive.cell.config.section import Colour, Section

__all__ = [
    "ArmConfig", "BinConfig", "CalibrationConfig", "CameraConfig", "CellConfig", "Colour", "DepthConfig",
    "DetectorConfig", "LedgerConfig", "LimitsConfig", "MotionConfig", "NoiseConfig", "ObjectConfig",
    "Section", "TableConfig", "ToolConfig",
]  # fmt: skip
