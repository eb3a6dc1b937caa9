"""Content of a cell file."""

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
    max_miss_probability: float = Field(0.001, ge=1e-9, lt=1)
    """Largest probability of an overlooked object at a position that counts as empty."""
    max_class_error: float = Field(0.005, ge=1e-9, lt=1)
    """Largest probability of a wrong class with which an item is sorted."""
    max_position_std: Length = 0.005
    """Largest standard error of the position of an item to approach [m]; two thirds after a failed grasp."""


class CellConfig(Section):
    """A cell: robot, tool, camera, table, bins, objects and detectors.

    Values are in SI units; values of keys that end in `_deg` are in degrees.
    """

    base: str = Field("", exclude=True)  # "" after loading.
    """Another cell file. This file inherits each missing top-level key, each missing detector and each
    missing key of a detector from it."""
    cell: Name
    """Name of the cell."""
    description: str = ""
    """Description of the cell in one sentence."""
    kind: str = "sim"
    """Kind of cell: `sim`, a simulated cell; `fake`, a cell without physics for rehearsals; or an installed
    kind (entry-point group `executive.cells`)."""
    arm: ArmConfig
    """Robot arm."""
    tool: ToolConfig
    """Suction tool."""
    motion: MotionConfig = MotionConfig()
    """Distances, speeds and times of motion planning."""
    table: TableConfig = TableConfig()
    """Workspace, and the objects that a simulated run puts there."""
    bins: dict[Name, BinConfig] = Field(min_length=1)
    """Bins by name."""
    cameras: dict[Name, CameraConfig] = Field(min_length=1, max_length=1)
    """The camera, by its name."""
    detector: str = ""
    """Name of the default detector of missions; if not given, the first of `detectors`."""
    detectors: dict[Name, DetectorConfig] = Field(min_length=1)
    """Detectors by name. With a `base`, a detector of the same name and kind changes keys of the base's
    detector, another kind replaces it, another name adds one, and a name without a value removes it."""
    localization: Literal["plane", "depth", "ray"] = "plane"
    """Height of a detected object: `plane`, from its class; `depth`, from the depth image; `ray`, from a ray
    of the simulator."""
    objects: dict[Name, ObjectConfig] = Field(min_length=1)
    """Classes of objects by name; their names are those that detectors report."""
    ledger: LedgerConfig = LedgerConfig()
    """Limits of the ledger, which tracks every object."""
    safe_place: Vector
    """Place on the table where `PutDown` puts an object: x, y, z [m]."""

    @field_validator("detectors")
    @classmethod
    def _put_default_first(
        cls, detectors: dict[str, DetectorConfig], others: ValidationInfo
    ) -> dict[str, DetectorConfig]:
        """Put the default detector before the others, because a mission that names none uses the first."""
        default = others.data.get("detector", "")
        if not default:
            return detectors
        if default not in detectors:
            names = ", ".join(detectors)
            raise ValueError(f'must have the detector "{default}", which is to be used; they are: {names}')
        return {default: detectors[default], **detectors}
