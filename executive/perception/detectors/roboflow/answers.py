"""What a server said, checked before anybody believes it.

inference-sdk hands on whatever comes: a server that answers `{"foo": 1}` has answered, as far as it cares.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from executive.cell.detection import Detection

MAX_PREDICTIONS = 300
"""Predictions in one answer; RF-DETR has 300 queries."""
MAX_OVERHANG = 0.1
"""Share of the image's side that a box may stick out by; it is cut off there."""

Finite = Annotated[float, Field(allow_inf_nan=False)]
Extent = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class _Prediction(BaseModel):
    """A box by centre and size [pixel] of the image sent."""

    model_config = ConfigDict(strict=True)

    x: Finite
    y: Finite
    width: Extent
    height: Extent
    confidence: Annotated[float, Field(ge=0, le=1)]
    label: str = Field(alias="class", min_length=1)


class _Size(BaseModel):
    width: Finite
    height: Finite


class _Answer(BaseModel):
    predictions: list[_Prediction] = Field(max_length=MAX_PREDICTIONS)
    image: _Size | None = None


def read_answer(answer: Any, size: tuple[int, int]) -> list[Detection]:
    """Return the detections that a server's answer holds, in its order.

    Args:
        answer: Its JSON.
        size: Width and height of the image it is about [pixel].

    Raises:
        ValueError: It holds something that cannot be; the text says what.
    """
    if not isinstance(answer, dict):
        raise ValueError(f"it is of type {type(answer).__name__}, not an object with predictions")
    try:
        read = _Answer.model_validate(answer)
    except ValidationError as error:
        raise ValueError(_first(error)) from None
    if read.image is not None and (read.image.width, read.image.height) != size:
        raise ValueError(
            f"it is about an image of {read.image.width:g} x {read.image.height:g} pixels, "
            f"and {size[0]} x {size[1]} were sent"
        )
    return list(_detections(read.predictions, size))


def read_output(output: Any, size: tuple[int, int]) -> list[Detection]:
    """Return the detections in an output of a workflow, in its order.

    An output is an answer, the predictions of an answer alone, or all outputs of a step (`$steps.model.*`),
    in which the answer stands under `predictions`. Without predictions the size of the image is null.

    Args:
        output: Its JSON.
        size: Width and height of the image that was sent [pixel].

    Raises:
        ValueError: It holds something that cannot be; the text says what.
    """
    if isinstance(output, dict) and isinstance(output.get("predictions"), dict):
        output = output["predictions"]
    elif isinstance(output, list):
        output = {"predictions": output}
    if isinstance(output, dict) and output.get("image") == {"width": None, "height": None}:
        output = {**output, "image": None}
    return read_answer(output, size)


def _detections(predictions: list[_Prediction], size: tuple[int, int]) -> Iterator[Detection]:
    """Yield the predictions with their boxes cut off at the border of the image."""
    width, height = size
    for index, found in enumerate(predictions):
        left, right = found.x - found.width / 2, found.x + found.width / 2
        top, bottom = found.y - found.height / 2, found.y + found.height / 2
        if (
            min(left / width, top / height) < -MAX_OVERHANG
            or max(right / width, bottom / height) > 1 + MAX_OVERHANG
            or not (0 <= found.x <= width and 0 <= found.y <= height)
        ):
            raise ValueError(
                f"predictions[{index}] is a box from ({left:.0f}, {top:.0f}) to ({right:.0f}, {bottom:.0f}) "
                f"in an image of {width} x {height} pixels"
            )
        box = max(left, 0.0), max(top, 0.0), min(right, float(width)), min(bottom, float(height))
        yield Detection(found.label, found.confidence, box)


def _first(error: ValidationError) -> str:
    """Return the first of what is wrong with an answer, with its place and without its values."""
    problem = error.errors(include_url=False, include_input=False)[0]
    place = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in problem["loc"])
    # Which class of ours it might be an instance of is nothing to a server.
    wrong = problem["msg"].partition(" or instance of")[0]
    return f"{place.removeprefix('.')}: {wrong[0].lower()}{wrong[1:]}"
