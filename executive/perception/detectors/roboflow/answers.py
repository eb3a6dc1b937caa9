"""Validation of the answers of an inference server.

inference-sdk does not validate answers: it returns any JSON, for instance `{"foo": 1}`.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from executive.cell.frame import Detection

MAX_PREDICTIONS = 300
"""Maximum number of predictions in one answer; RF-DETR has 300 queries."""
MAX_OVERHANG = 0.1
"""Maximum extent of a box beyond the image, as a fraction of the image size; such boxes are clipped."""
MIN_BOX_AREA = 4.0
"""Minimum area of a box that shows an object [pixel²]; coordinates in fractions of the image give less."""

FiniteFloat = Annotated[float, Field(allow_inf_nan=False)]
PositiveFloat = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class _ImageSize(BaseModel):
    """Width and height of an image [pixel]; 0 if unknown."""

    width: FiniteFloat = 0.0
    height: FiniteFloat = 0.0


class _Origin(_ImageSize):
    """Position of a crop in an image [pixel], and the size of the image."""

    offset_x: FiniteFloat
    offset_y: FiniteFloat


class _Prediction(BaseModel):
    """Centre and size of a box [pixel of the sent image, or of a crop], class and confidence."""

    model_config = ConfigDict(strict=True)

    x: FiniteFloat
    y: FiniteFloat
    width: PositiveFloat
    height: PositiveFloat
    confidence: Annotated[float, Field(ge=0, le=1)]
    label: str = Field(alias="class", min_length=1)
    angle: FiniteFloat | None = None
    """Rotation of the sides of the box, which the block "Bounding Rectangle" of a workflow adds [degree]."""
    parent_origin: _Origin | None = None
    """Origin of a crop in its parent image, which may be a crop itself."""
    root_parent_origin: _Origin | None = None
    """Origin of a crop in the sent image."""

    @property
    def origin(self) -> _Origin | None:
        """Origin of the crop that contains the box; None if the box is in pixels of the sent image."""
        return self.root_parent_origin or self.parent_origin


class _Answer(BaseModel):
    """Answer of a server, with the size of the image that the server processed [pixel]."""

    predictions: list[_Prediction] = Field(max_length=MAX_PREDICTIONS)
    image: _ImageSize | None = None


def read_answer(answer: Any, size: tuple[int, int], is_of_crop: bool = False) -> list[Detection]:
    """Return the detections in an answer of a server, in the order of the answer.

    Args:
        answer: Decoded JSON of the answer.
        size: Width and height of the sent image [pixel].
        is_of_crop: True if the answer may concern a crop of the sent image; it must then state the place.

    Raises:
        ValueError: The answer is invalid; the message states position and problem.
    """
    if not isinstance(answer, dict):
        raise ValueError(f'it is of type {type(answer).__name__}, not an object with the key "predictions"')
    try:
        validated = _Answer.model_validate(answer)
    except ValidationError as error:
        raise ValueError(_describe_first_error(error)) from None
    # The size of the image in an answer about a crop is the size of the crop.
    origins = [prediction.origin for prediction in validated.predictions]
    images = [origin or validated.image for origin in origins]
    if (is_of_crop or any(origins)) and not all(images):
        raise ValueError("it contains predictions per crop without the place of the crop in the image")
    image_sizes = {(image.width, image.height) for image in images or [validated.image] if image}
    for width, height in image_sizes - {size, (0.0, 0.0)}:
        problem = f"it is for an image of {width:g} x {height:g} pixels"
        raise ValueError(f"{problem}, but the sent image has {size[0]} x {size[1]}")
    return list(_convert_predictions(validated.predictions, size))


def read_output(output: Any, size: tuple[int, int], is_of_crop: bool = False) -> list[Detection]:
    """Return the detections in an output of a workflow, in the order of the output.

    An output is an answer, or a list of predictions, or a mapping of all outputs of a step (`$steps.model.*`)
    whose key `predictions` contains an answer. In an answer without predictions, the image size is null. A
    workflow with crops returns a list with one output per crop, which is null for a crop without a result.

    Args:
        output: Decoded JSON of the output.
        size: Width and height of the sent image [pixel].
        is_of_crop: True if the output may concern a crop of the sent image.

    Raises:
        ValueError: The output is invalid; the message states position and problem.
    """
    if isinstance(output, list) and not all(isinstance(entry, dict) and "x" in entry for entry in output):
        return [found for crop in output if crop is not None for found in read_output(crop, size, True)]
    if isinstance(output, dict) and isinstance(output.get("predictions"), dict):
        output = output["predictions"]
    elif isinstance(output, list):
        output = {"predictions": output}
    if isinstance(output, dict) and output.get("image") == {"width": None, "height": None}:
        output = {**output, "image": None}
    return read_answer(output, size, is_of_crop)


def _convert_predictions(predictions: list[_Prediction], size: tuple[int, int]) -> Iterator[Detection]:
    """Yield the predictions as detections, with boxes clipped to the image."""
    width, height = size
    for index, prediction in enumerate(predictions):
        if prediction.width * prediction.height < MIN_BOX_AREA:
            box_size = f"{prediction.width:g} x {prediction.height:g} pixels"
            raise ValueError(f"predictions[{index}] is a box of {box_size}, as if in fractions of the image")
        origin = prediction.origin or _Origin(offset_x=0.0, offset_y=0.0)
        x, y = prediction.x + origin.offset_x, prediction.y + origin.offset_y
        angle = math.radians(prediction.angle or 0.0)
        sine, cosine = abs(math.sin(angle)), abs(math.cos(angle))
        half_width = (prediction.width * cosine + prediction.height * sine) / 2
        half_height = (prediction.width * sine + prediction.height * cosine) / 2
        left, right = x - half_width, x + half_width
        top, bottom = y - half_height, y + half_height
        if (
            min(left / width, top / height) < -MAX_OVERHANG
            or max(right / width, bottom / height) > 1 + MAX_OVERHANG
            or not (0 <= x <= width and 0 <= y <= height)
        ):
            corners = f"({left:.0f}, {top:.0f}) to ({right:.0f}, {bottom:.0f})"
            image = f"an image of {width} x {height} pixels"
            raise ValueError(f"predictions[{index}] is a box from {corners} in {image}")
        box = max(left, 0.0), max(top, 0.0), min(right, float(width)), min(bottom, float(height))
        yield Detection(prediction.label, prediction.confidence, box)


def _describe_first_error(error: ValidationError) -> str:
    """Return position and message of the first error in an answer, without values of the answer."""
    problem = error.errors(include_url=False, include_input=False)[0]
    position = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in problem["loc"])
    # The rest of the message names classes of this module, which the user does not know.
    message = problem["msg"].partition(" or instance of")[0]
    return f"{position.removeprefix('.')}: {message[0].lower()}{message[1:]}"
