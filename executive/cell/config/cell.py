"""A whole cell file."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, ValidationInfo, field_validator

from executive.cell.config.arm import ArmConfig, MotionConfig, ToolConfig
from executive.cell.config.cameras import CameraConfig
from executive.cell.config.detectors import DetectorConfig
from executive.cell.config.objects import BinConfig, ObjectConfig, TableConfig
from executive.cell.config.section import Distance, Length, Name, Section, Vector


class LedgerConfig(Section):
    """Limits of the ledger."""

    gate: Length = 0.025
    """Largest distance between a precise detection and the item that it shows [m]."""
    neighbourhood: Distance = 0.07
    """Radius around a picked item in which others may have been moved [m]."""
    overlooked: float = Field(0.001, ge=1e-9, lt=1)
    """Largest probability of an overlooked object at a position that counts as empty."""
    misjudged: float = Field(0.005, ge=1e-9, lt=1)
    """Largest probability of a wrong class with which an item is sorted."""
    aim: Length = 0.005
    """Largest standard error of the position of an item to approach [m]; two thirds after a failed grasp."""


class CellConfig(Section):
    """A whole cell file."""

    base: str = Field("", exclude=True)
    """Another cell file. It gives every key of the first level that this file lacks, and every detector and
    key of a detector that `detectors` lacks; "" once it has."""
    cell: Name
    """Name of the cell."""
    description: str = ""
    """One sentence."""
    kind: str = "sim"
    """Kind of cell (entry-point group `executive.cells`)."""
    arm: ArmConfig
    tool: ToolConfig
    motion: MotionConfig = MotionConfig()
    table: TableConfig = TableConfig()
    bins: dict[Name, BinConfig] = Field(min_length=1)
    cameras: dict[Name, CameraConfig] = Field(min_length=1, max_length=1)
    detector: str = ""
    """The one of `detectors` that missions use unless they name another; "": the first."""
    detectors: dict[Name, DetectorConfig] = Field(min_length=1)
    """By name. With a `base`, a detector of the same name and kind changes keys of the base's detector,
    another kind replaces it, another name adds a detector, and a name without a value removes one."""
    localization: Literal["plane", "depth", "ray"] = "plane"
    objects: dict[Name, ObjectConfig] = Field(min_length=1)
    ledger: LedgerConfig = LedgerConfig()
    safe_place: Vector
    """Where something held may be put down on the table."""

    @field_validator("detectors")
    @classmethod
    def _the_chosen_one_first(
        cls, detectors: dict[str, DetectorConfig], others: ValidationInfo
    ) -> dict[str, DetectorConfig]:
        """Put the detector that is named before the others: whoever names none takes the first."""
        chosen = others.data.get("detector", "")
        if not chosen:
            return detectors
        if chosen not in detectors:
            names = ", ".join(detectors)
            raise ValueError(f'must have the detector "{chosen}", which is to be used; they are: {names}')
        return {chosen: detectors[chosen], **detectors}
