"""A whole cell file."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from executive.cell_config.arm import ArmConfig, MotionConfig, ToolConfig
from executive.cell_config.cameras import CameraConfig
from executive.cell_config.detectors import DetectorConfig
from executive.cell_config.objects import BinConfig, ObjectConfig, TableConfig
from executive.cell_config.section import Section, Vector


class LedgerConfig(Section):
    """When the ledger believes what."""

    gate: float = Field(0.025, gt=0)
    """Largest distance between a detection and the item it is bound to [m]."""
    neighbourhood: float = Field(0.07, ge=0)
    """Radius around a picked item in which others may have been moved [m]."""
    looks_to_believe: int = Field(2, ge=1)
    """Looks at the full frame that must agree before the table is believed empty."""


class CellConfig(Section):
    """A whole cell file."""

    base: str = Field("", exclude=True)
    """Another cell file, which gives every key of the first level that this one does not; "" once it has."""
    cell: str
    """Name of the cell."""
    description: str = ""
    """One sentence."""
    kind: str = "sim"
    """Kind of cell (entry-point group `executive.cells`)."""
    arm: ArmConfig
    tool: ToolConfig
    motion: MotionConfig = MotionConfig()
    table: TableConfig = TableConfig()
    bins: dict[str, BinConfig] = Field(min_length=1)
    cameras: dict[str, CameraConfig] = Field(min_length=1, max_length=1)
    detectors: dict[str, DetectorConfig] = Field(min_length=1)
    localization: Literal["plane", "depth", "ray"] = "plane"
    objects: dict[str, ObjectConfig] = Field(min_length=1)
    ledger: LedgerConfig = LedgerConfig()
    safe_place: Vector
    """Where something held may be put down on the table."""
