"""What every part of a cell file has in common, and the kinds of values in it."""

from __future__ import annotations

import re
from typing import Annotated, TypeVar

from pydantic import AfterValidator, BaseModel, ConfigDict, Field

Number = TypeVar("Number", int, float)


def check_rising(pair: tuple[Number, Number]) -> tuple[Number, Number]:
    """Return a range as it is.

    Raises:
        ValueError: It falls.
    """
    if pair[0] > pair[1]:
        raise ValueError(f"must not fall: {pair[0]:g} stands before {pair[1]:g}")
    return pair


NAME = re.compile(r"\w[\w -]{0,63}")


def check_name(name: str) -> str:
    """Return the name of a class, bin, camera or detector as it is: it becomes part of file names.

    Raises:
        ValueError: It has other characters than letters, digits, blanks, "_" and "-", or more than 64.
    """
    if not NAME.fullmatch(name):
        raise ValueError('must be named by at most 64 letters, digits, blanks, "_" and "-"')
    return name


Name = Annotated[str, AfterValidator(check_name)]
SMALLEST, LARGEST = 1e-4, 10.0
"""Smallest and largest length in a cell [m]: a tenth of a millimetre is below every sensor's error, and 10 m
is beyond every arm's reach."""
Length = Annotated[float, Field(ge=SMALLEST, le=LARGEST)]
Distance = Annotated[float, Field(ge=0, le=LARGEST)]
Coordinate = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Count = Annotated[int, Field(ge=1, le=1000)]
"""A number of things [1]; a bin, a table or an image holds less than a thousand of them."""
Natural = Annotated[int, Field(ge=0, le=1000)]
Range = Annotated[tuple[Coordinate, Coordinate], AfterValidator(check_rising)]
Vector = Annotated[tuple[Coordinate, Coordinate, Coordinate], Field(description="x, y, z [m]")]
Angle = Annotated[float, Field(ge=-360, le=360)]
"""An angle [degree]; a whole turn to either side covers all orientations."""
Angles = Annotated[tuple[Angle, Angle, Angle], Field(description="roll, pitch, yaw [degree]")]
Joints = tuple[Angle, Angle, Angle, Angle, Angle, Angle, Angle]
Force = Annotated[float, Field(ge=1e-3, le=1e4)]
"""A force [N]: from the weight of a tenth of a gram to that of a ton."""
Channel = Annotated[float, Field(ge=0, le=1)]
Colour = tuple[Channel, Channel, Channel]
Share = Annotated[float, Field(ge=0, le=1)]
Seconds = Annotated[float, Field(ge=0, le=600)]
"""A time [s]; a step of ten minutes is an error of the cell."""
GreyLevels = Annotated[float, Field(ge=0, le=255)]


class Section(BaseModel):
    """A part of a cell file: unknown keys are errors, values do not change after loading."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)
