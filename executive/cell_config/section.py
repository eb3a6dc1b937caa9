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
Length = Annotated[float, Field(gt=0)]
Count = Annotated[int, Field(ge=1)]
Natural = Annotated[int, Field(ge=0)]
Range = Annotated[tuple[float, float], AfterValidator(check_rising)]
Vector = Annotated[tuple[float, float, float], Field(description="x, y, z [m]")]
Joints = tuple[float, float, float, float, float, float, float]
Limits = tuple[Length, Length, Length, Length, Length, Length, Length]
Colour = tuple[float, float, float]


class Section(BaseModel):
    """A part of a cell file: unknown keys are errors, values do not change after loading."""

    model_config = ConfigDict(extra="forbid", frozen=True, use_attribute_docstrings=True)
