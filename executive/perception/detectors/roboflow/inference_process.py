"""Helper process that runs inference-sdk and is replaced after a missed deadline; validation of its answers.

inference-sdk does not validate answers: it returns any JSON, for instance `{"foo": 1}`.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import signal
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError

import executive
from executive.cell.frame import Detection
from executive.errors import Fault, Unavailable
from executive.geometry import rotate_about_z
from executive.processes import build_command

KEY_VARIABLE = "ROBOFLOW_API_KEY"
"""Environment variable with the API key, the only source of the key."""
MIN_KEY_LENGTH = 8
"""Minimum length of a secret key; shorter keys are placeholders for servers that accept any key."""
REDACTED_KEY = "***"
"""Text that replaces the key in messages."""
PROGRAM = "executive.perception.detectors.roboflow"
"""Module that the helper process runs."""
STARTUP_TIMEOUT = 30.0
"""Maximum time for the import of inference-sdk [s]; measured: 2 s, and 6 s on shared cores."""
EXIT_TIMEOUT = 1.0
"""Maximum time between the end of the program's output and the exit of the program [s]."""
MAX_STDERR_SIZE = 2000
"""Maximum number of bytes at the end of the standard error that are read for an error message."""
MAX_PREDICTIONS = 300
"""Maximum number of predictions in one answer; RF-DETR has 300 queries."""
MAX_OVERHANG = 0.1
"""Maximum extent of a box beyond the image, as a fraction of the image size; such boxes are clipped."""
MIN_BOX_AREA = 4.0
"""Minimum area of a box that shows an object [pixel²]; coordinates in fractions of the image give less."""

FiniteFloat = Annotated[float, Field(allow_inf_nan=False)]
PositiveFloat = Annotated[float, Field(gt=0, allow_inf_nan=False)]


class ApiKey:
    """API key from the environment; only the attribute `environment` contains the key as text."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self.environment = dict(environment)
        """Environment variables of the process that uses the key."""
        self._key = environment.get(KEY_VARIABLE, "").strip()
        self.is_set = bool(self._key)
        """True if the environment contains a key."""

    def redact(self, text: str) -> str:
        """Return `text`, plain or JSON, without the key."""
        if len(self._key) < MIN_KEY_LENGTH:
            return text
        return text.replace(self._key, REDACTED_KEY).replace(json.dumps(self._key)[1:-1], REDACTED_KEY)

    def __repr__(self) -> str:
        return f"ApiKey({REDACTED_KEY if self.is_set else ''})"


class NoAnswer(Exception):
    """The server did not answer before the deadline.

    Attributes:
        retry_causes: HTTP statuses that caused retries before the deadline; None for no connection.
    """

    def __init__(self, retry_causes: Sequence[int | None]) -> None:
        super().__init__()
        self.retry_causes = tuple(retry_causes)


class InferenceProcess:
    """Helper process that runs inference-sdk; the constructor starts the process, and `close` ends it.

    If the process does not answer before the deadline of a call, the process is killed and replaced. One
    thread sends requests; another thread may call `stop`.

    Args:
        settings: Server, model or workflow, and minimum confidence, for the program.
        key: API key of the user.
    """

    def __init__(self, settings: Mapping[str, Any], key: ApiKey) -> None:
        self._command = build_command(PROGRAM, json.dumps(settings))
        self._key = key
        self._stderr = tempfile.TemporaryFile()  # noqa: SIM115 `close` closes the file.
        self._lock = threading.Lock()
        self._is_stopped = False
        self._process: subprocess.Popen[bytes] | None = None
        self._is_ready = False
        self._startup_deadline = 0.0
        self._restart()

    def wait_until_ready(self) -> None:
        """Wait until the process has imported inference-sdk.

        Raises:
            Unavailable: The process could not be started, or was not ready within `STARTUP_TIMEOUT`.
            Fault: The process exited.
        """
        if self._process is None:
            self._start()
        if self._is_ready:
            return
        try:
            message = self._send_and_receive(b"", self._startup_deadline)
        except TimeoutError:
            raise Unavailable(f"its helper process was not ready within {STARTUP_TIMEOUT:.0f} s") from None
        if "setup_error" in message:
            self._discard_process()
            problem = f"inference-sdk cannot be used: {message['setup_error']}"
            raise Unavailable(f"{problem}; `executive doctor` checks packages")
        self._is_ready = True

    def request(self, image: NDArray[np.uint8], deadline: float) -> Mapping[str, Any]:
        """Send an image to the ready process; return a mapping with `answer`, or with `failure` and `detail`.

        Args:
            image: `(H, W, 3)` RGB.
            deadline: Latest time of the answer, on the clock `time.monotonic` [s].

        Raises:
            NoAnswer: There was no answer before the deadline.
            Unavailable: Another process killed the helper process.
            Fault: The process exited.
        """
        height, width = image.shape[:2]
        data = json.dumps({"width": width, "height": height}).encode() + b"\n" + image.tobytes()
        retry_causes: list[int | None] = []
        while True:
            try:
                message = self._send_and_receive(data, deadline)
            except TimeoutError:
                raise NoAnswer(retry_causes) from None
            if "retry_status" not in message:
                return message
            retry_causes.append(message["retry_status"])
            data = b""

    def stop(self) -> None:
        """Kill the process; a concurrent call of `request` or `wait_until_ready` raises `Unavailable`."""
        with self._lock:
            self._is_stopped = True
            if self._process is not None:
                _kill(self._process)

    def close(self) -> None:
        """Release all resources; no other call may be active."""
        self.stop()
        self._discard_process()
        self._stderr.close()

    def _send_and_receive(self, data: bytes, deadline: float) -> Mapping[str, Any]:
        """Send `data` and return the next message of the process; replace a late or exited process."""
        process = self._process
        assert process is not None and process.stdin and process.stdout
        is_late = threading.Event()

        def kill_late_process() -> None:
            is_late.set()
            _kill(process)

        # A killed process closes its pipes, so that neither `write` nor `readline` below waits forever.
        timer = threading.Timer(max(deadline - time.monotonic(), 0.0), kill_late_process)
        timer.start()
        try:
            with contextlib.suppress(BrokenPipeError):
                process.stdin.write(data)
                process.stdin.flush()
            line = process.stdout.readline()
        finally:
            timer.cancel()
            timer.join()
        if is_late.is_set():
            self._restart()
            raise TimeoutError
        if not line.endswith(b"\n"):
            self._raise_exit_error(process)
        try:
            message: Mapping[str, Any] = json.loads(self._key.redact(line.decode()))
        except RecursionError:
            # The parser of the helper process reaches its recursion limit later: fewer calls are active.
            return {"failure": "invalid", "detail": "the answer is nested too deeply"}
        return message

    def _raise_exit_error(self, process: subprocess.Popen[bytes]) -> None:
        """Replace a process that has closed its output, and raise an error with the cause of its exit."""
        try:
            status = process.wait(EXIT_TIMEOUT)
        except subprocess.TimeoutExpired:
            _kill(process)
            status = process.wait()
        self._stderr.seek(max(self._stderr.seek(0, os.SEEK_END) - MAX_STDERR_SIZE, 0))
        lines = self._stderr.read().decode(errors="replace").strip().splitlines()
        self._restart()
        if status < 0:
            raise Unavailable(f"its helper process was ended by signal {-status}")
        last_line = self._key.redact(lines[-1].strip() if lines else "")
        raise Fault(f"the program {PROGRAM} ended with status {status}: {last_line}")

    def _restart(self) -> None:
        """Discard the process, if any, and start another one in the background, if possible."""
        self._discard_process()
        with contextlib.suppress(Unavailable):
            self._start()

    def _start(self) -> None:
        """Start a process in the background.

        Raises:
            Unavailable: The helper is stopped, or the process could not be started.
        """
        with self._lock:
            if self._is_stopped:
                raise Unavailable("its helper process is not running: the detector is closed")
            self._stderr.seek(0)
            self._stderr.truncate()
            try:
                self._process = subprocess.Popen(
                    self._command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._stderr,
                    env=self._key.environment,
                    # `-m` searches the working folder first; the user's folder could contain other modules.
                    cwd=Path(executive.__file__).parent.parent,
                    start_new_session=True,  # Ctrl-C does not interrupt the process.
                )  # fmt: skip
            except OSError as error:
                cause = (error.strerror or str(error)).lower()
                raise Unavailable(f"its helper process is not running: {cause}") from error
            self._startup_deadline = time.monotonic() + STARTUP_TIMEOUT
            self._is_ready = False

    def _discard_process(self) -> None:
        """Kill the process, if any, and close its pipes."""
        with self._lock:
            process = self._process
            self._process = None
        if process is None:
            return
        _kill(process)
        process.wait()
        for pipe in (process.stdin, process.stdout):
            with contextlib.suppress(OSError):  # Closing flushes unsent data, which fails for a dead process.
                assert pipe is not None
                pipe.close()


def _kill(process: subprocess.Popen[bytes]) -> None:
    """Kill a helper process and all processes that it started, which might hold its output open."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(process.pid, signal.SIGKILL)


class _ImageSize(BaseModel):
    """Width and height of an image [pixel]; 0 if unknown."""

    width: FiniteFloat = 0.0
    height: FiniteFloat = 0.0


class _Origin(_ImageSize):
    """Position of a crop in an image [pixel], and the size of the image."""

    offset_x: FiniteFloat
    offset_y: FiniteFloat


class _Point(BaseModel):
    """Vertex of a polygon [pixel of the sent image, or of a crop]."""

    x: FiniteFloat
    y: FiniteFloat


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
    """Rotation of the sides of the box from the x axis to the y axis of the image, which the block "Bounding
    Rectangle" of a workflow adds [degree]."""
    points: list[_Point] = []
    """Polygon around the mask that a model for instance segmentation found."""
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
    """Yield the predictions as detections, with boxes clipped to the image.

    The outline of a detection is the polygon around its mask, or consists of the corners of a rotated box.
    """
    for index, prediction in enumerate(predictions):
        if prediction.width * prediction.height < MIN_BOX_AREA:
            box_size = f"{prediction.width:g} x {prediction.height:g} pixels"
            raise ValueError(f"predictions[{index}] is a box of {box_size}, as if in fractions of the image")
        origin = prediction.origin or _Origin(offset_x=0.0, offset_y=0.0)
        centre = np.array([prediction.x + origin.offset_x, prediction.y + origin.offset_y])
        rotation = rotate_about_z(math.radians(prediction.angle or 0.0))[:2, :2]
        half_size = np.array([prediction.width, prediction.height]) / 2
        corners = centre + half_size * [(-1, -1), (1, -1), (1, 1), (-1, 1)] @ rotation.T
        low = corners.min(axis=0)
        high = corners.max(axis=0)
        is_centre_inside = ((centre >= 0) & (centre <= size)).all()
        overhang = max((-low / size).max(), (high / size - 1).max())
        if overhang > MAX_OVERHANG or not is_centre_inside:
            place = "({:.0f}, {:.0f}) to ({:.0f}, {:.0f})".format(*low, *high)
            image = f"an image of {size[0]} x {size[1]} pixels"
            raise ValueError(f"predictions[{index}] is a box from {place} in {image}")
        left, top = np.maximum(low, 0.0).tolist()
        right, bottom = np.minimum(high, size).tolist()
        box = (left, top, right, bottom)
        outline = [(point.x + origin.offset_x, point.y + origin.offset_y) for point in prediction.points]
        if prediction.angle is not None and not outline:
            outline = [(x, y) for x, y in corners.tolist()]
        yield Detection(prediction.label, prediction.confidence, box, outline=tuple(outline) or None)


def _describe_first_error(error: ValidationError) -> str:
    """Return position and message of the first error in an answer, without values of the answer."""
    problem = error.errors(include_url=False, include_input=False)[0]
    position = "".join(f"[{step}]" if isinstance(step, int) else f".{step}" for step in problem["loc"])
    # The rest of the message names classes of this module, which the user does not know.
    message = problem["msg"].partition(" or instance of")[0]
    return f"{position.removeprefix('.')}: {message[0].lower()}{message[1:]}"
