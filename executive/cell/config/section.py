"""Base class of the sections of a cell file, and types of values with their ranges."""

from __future__ import annotations

import re
from typing import Annotated, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

Number = TypeVar("Number", int, float)


def check_ascending(pair: tuple[Number, Number]) -> tuple[Number, Number]:
    """Return the range unchanged if its limits are in ascending order.

    Raises:
        ValueError: The lower limit is greater than the upper limit.
    """
    if pair[0] > pair[1]:
        raise ValueError(f"must be in ascending order: {pair[0]:g} is greater than {pair[1]:g}")
    return pair


NAME_PATTERN = re.compile(r"\w[\w -]{0,63}")
"""Permitted names: a letter, digit or `_`, and at most 63 letters, digits, blanks, `_` and `-`."""


def check_name(name: str) -> str:
    """Return the name of a class, bin, camera or detector unchanged if it can be part of a file name.

    Raises:
        ValueError: The name does not match `NAME_PATTERN`.
    """
    if not NAME_PATTERN.fullmatch(name):
        raise ValueError('must be a name of at most 64 letters, digits, blanks, "_" and "-"')
    return name


Name = Annotated[str, AfterValidator(check_name)]
MIN_LENGTH, MAX_LENGTH = 1e-4, 10.0
"""Minimum and maximum length in a cell [m]: below the error of each sensor, above the reach of each arm."""
Length = Annotated[float, Field(ge=MIN_LENGTH, le=MAX_LENGTH)]
"""A positive length [m]."""
Distance = Annotated[float, Field(ge=0, le=MAX_LENGTH)]
"""A length that may be 0 [m]."""
Coordinate = Annotated[float, Field(ge=-MAX_LENGTH, le=MAX_LENGTH)]
"""A coordinate of a point [m]."""
Count = Annotated[int, Field(ge=1, le=1000)]
"""A positive number of objects; no bin, table or image has more than 1000 objects."""
Natural = Annotated[int, Field(ge=0, le=1000)]
"""An integer that may be 0."""
Range = Annotated[tuple[Coordinate, Coordinate], AfterValidator(check_ascending)]
"""Minimum and maximum coordinate [m]."""
Vector = tuple[Coordinate, Coordinate, Coordinate]
"""x, y, z [m]."""
Angle = Annotated[float, Field(ge=-360, le=360)]
"""An angle [degree], up to one revolution in each direction."""
Angles = tuple[Angle, Angle, Angle]
"""Roll, pitch, yaw [degree]."""
Force = Annotated[float, Field(ge=1e-3, le=1e4)]
"""A force [N]: from the weight of 0.1 g to the weight of 1 t."""
Fraction = Annotated[float, Field(ge=0, le=1)]
"""A fraction, 0 to 1."""
Colour = tuple[Fraction, Fraction, Fraction]
"""Red, green and blue, 0 to 1."""
Seconds = Annotated[float, Field(ge=0, le=600)]
"""A duration [s]; more than ten minutes is an error in the cell file."""


class Section(BaseModel):
    """A section of a cell file: unknown keys are errors, and the values are immutable."""

    model_config = ConfigDict(extra="forbid", frozen=True)
