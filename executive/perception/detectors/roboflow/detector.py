"""Detector that sends images to a Roboflow inference server."""

from __future__ import annotations

import os
import re
import threading
import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any, Literal
from urllib.parse import urlsplit
from urllib.request import getproxies

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from executive.cell.config import DetectorConfig
from executive.cell.frame import Detection, Frame
from executive.errors import DeadlinePassed, InputError, Unavailable
from executive.perception.detectors.detector_registry import DetectorContext, DetectorOptions, OptionErrors
from executive.perception.detectors.roboflow.inference_process import (
    KEY_VARIABLE,
    ApiKey,
    InferenceProcess,
    NoAnswer,
    read_answer,
    read_output,
)
from executive.perception.detectors.views import list_regions, remove_duplicates, search_regions

HOSTED_URL = "https://serverless.roboflow.com"
"""Address of Roboflow's hosted server."""
SECRET_WORDS = ("key", "token", "secret", "password", "authorization")
"""Substrings of the names of unknown options whose values are probably secrets."""
WORKFLOW_OPTIONS = ("workspace", "workflow_id", "workflow_input", "workflow_output")
"""Options that only `api: workflow` uses."""
FORBIDDEN_CHARACTERS = "?&#= "
"""Characters that are not allowed in names, because they would change the URL of a request."""
MAX_DETAIL_LENGTH = 100
"""Maximum number of characters that are quoted from a message of a server."""

_KEY_ADVICE = f"set {KEY_VARIABLE} to a key that may use it"
_TEMPLATE_BY_STATUS: Mapping[int, tuple[str, str]] = {
    400: ("rejected the request", "check {options} and api"),
    401: ("does not accept the key", _KEY_ADVICE),
    402: ("requires a payment", f"check the plan of the account to which {KEY_VARIABLE} belongs"),
    403: ("does not accept the key", _KEY_ADVICE),
    404: ("has no {model}", "check {options} and url"),
    413: ("rejected the image as too large", "give the camera a smaller table_view, or set full: tiles"),
    429: ("received too many requests", "reduce the request rate, or check the plan of the account"),
    500: ("had an internal error", "check its log"),
    502: ("is a gateway without a connection to the server", "check that the server is running"),
    503: ("is not ready, or cannot load {model}", "check its log and {options}"),
}
"""Failure and advice by HTTP status, with placeholders for the names of the model and the options."""
_UNKNOWN_STATUS = ("reported an unexpected status", "check its log")
_TEMPLATE_BY_KIND: Mapping[str, tuple[str, str]] = {
    "no key": ("requires a key", f"set {KEY_VARIABLE}"),
    "no model": ("has no {model}", "check {options}"),
    "no detector": ("has a {model} that detects no objects", "check {options}"),
    "no output": ('ran {model}, which has no output "{output}"', "check workflow_output"),
    "refused": ("refused the connection", "check that the server is running, and check url"),
    "unknown host": ("has an unknown host name", "check url and the network"),
    "tls": ("failed the TLS handshake", "check url, the certificate and the clock"),
    "lost": ("closed the connection", "check its log and the network"),
    "invalid": ("sent an answer that inference-sdk cannot read", "check that url is an inference server"),
    "other": ("could not be queried", "check the error of inference-sdk"),
}
"""Failure and advice by `failure` in the messages of the helper process."""


class RoboflowOptions(DetectorOptions):
    """Options of a detector of kind `roboflow`, in addition to the options of all detectors."""

    model_id: str = ""
    """Model id on the server: `project/version`, or an alias of inference-sdk such as `rfdetr-nano`; not used
    by `api: workflow`."""
    url: str = HOSTED_URL
    """Address of the inference server."""
    api: Literal["auto", "v0", "v1", "workflow"] = "auto"
    """API of the server. `v0`: one request to `/project/version`. `v1`: API of self-hosted servers. `auto`:
    inference-sdk chooses `v0` or `v1`. `workflow`: a workflow of a workspace."""
    workspace: str = ""
    """Name of the workflow's workspace, as in the URL of the workflow."""
    workflow_id: str = ""
    """Name of the workflow, as in the URL of the workflow."""
    workflow_input: str = Field("image", min_length=1)
    """Name of the workflow's input for the image."""
    workflow_output: str = Field("predictions", min_length=1)
    """Name of the workflow's output with the predictions of an object detection model."""
    class_map: dict[str, str] = Field(default_factory=dict)
    """Class names of the cell by class names of the model, if the names differ."""
    labels: tuple[str, ...] = ()
    """Class names of the model, for the check that a mission requests only these classes."""
    deadline: float = Field(1.0, gt=0, le=60)
    """Maximum time for all answers about one frame, on the wall clock and on the clock of the run [s],
    including the retries of inference-sdk after the HTTP statuses 429, 503 and 504."""
    full: Literal["whole", "tiles"] = "whole"
    """Images that are sent for the view `full`. `whole`: the frame. `tiles`: tiles of the size of the table
    view that overlap by at least a quarter (9 tiles for 640 x 480 pixels and a table view of 256 x 256). For
    the view `table`, one image is sent. Requests per image: one with `v0` and `workflow`; two with `v1`, the
    first for the list of loaded models; three with `v1` if the server has not loaded the model."""

    @property
    def is_local(self) -> bool:
        """True if the server runs on this computer."""
        pattern = r"localhost|0\.0\.0\.0|::1|127(\.\d+){1,3}"
        return re.fullmatch(pattern, urlsplit(self.url).hostname or "") is not None

    @property
    def server_origin(self) -> str:
        """Scheme, host and port of the server's address, for messages, with a note if a proxy is used."""
        parts = urlsplit(self.url)
        origin = f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}"
        if self.is_local or not getproxies():
            return origin
        # The import takes 0.2 s, and most computers have no proxy.
        from requests.utils import get_environ_proxies, select_proxy

        note = f", through the proxy in {parts.scheme.upper()}_PROXY or ALL_PROXY (see NO_PROXY),"
        return f"{origin}{note}" if select_proxy(self.url, get_environ_proxies(self.url)) else origin

    @classmethod
    def find_errors(cls, config: DetectorConfig) -> OptionErrors:
        """Yield each invalid option in the section `config`, with an error message."""
        errors = list(super().find_errors(config))
        for option, message in errors:
            if any(part in option.lower() for part in SECRET_WORDS):
                problem = f'"{option}" does not belong in a cell file, because others can read the file'
                message = f"{problem}; delete the option and set the environment variable {KEY_VARIABLE}"
            yield option, message
        if errors:
            return
        options = cls.model_validate(config.options)
        yield from _check_url(options.url)
        yield from _check_workflow(options) if options.api == "workflow" else _check_model(options)
        if options.labels:
            yield from cls.find_class_map_errors(config, options.class_map, options.labels)


def _check_model(options: RoboflowOptions) -> OptionErrors:
    api = options.api
    model_id = options.model_id
    parts = model_id.split("/")
    if unused_options := [name for name in WORKFLOW_OPTIONS if name in options.model_fields_set]:
        names = ", ".join(unused_options)
        yield unused_options[0], f"api: {api} does not use {names}; write api: workflow, or delete {names}"
    elif not model_id:
        yield "model_id", f"api: {api} needs model_id: project/version, or a name such as rfdetr-nano"
    elif any(character in model_id for character in FORBIDDEN_CHARACTERS):
        yield "model_id", "model_id must be a name or project/version, without ?, &, #, = or a space"
    elif api == "v0" and (len(parts) > 2 or not all(parts)):
        problem = "must be project/version for v0, or a name such as rfdetr-nano"
        yield "model_id", f'model_id {problem}, not "{model_id}"'


def _check_workflow(options: RoboflowOptions) -> OptionErrors:
    names = {"workspace": options.workspace, "workflow_id": options.workflow_id}
    for option, name in names.items():
        if not name:
            yield option, f"api: workflow needs workspace and workflow_id; {option} is missing"
        elif any(character in name for character in f"{FORBIDDEN_CHARACTERS}/"):
            yield option, f"{option} must be a name without /, ?, &, #, = or a space"


def _check_url(url: str) -> OptionErrors:
    """Yield an error for the option `url` if its value is not a plain server address."""
    try:
        parts = urlsplit(url)
        is_server_address = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
    except ValueError:
        is_server_address = False
    if not is_server_address:
        yield "url", "url must be an address such as http://127.0.0.1:9001 or https://serverless.roboflow.com"
    elif "@" in parts.netloc or parts.query or parts.fragment:
        yield "url", f"url must not contain a user, query or fragment; set {KEY_VARIABLE} to the key"


def describe_failure(failure: Mapping[str, Any], options: RoboflowOptions) -> str:
    """Return the message about a failure that the helper process reports."""
    detail = shorten_to_line(str(failure.get("detail", "")))
    status = failure.get("status")
    if status is None:
        problem, advice = _fill_in(_TEMPLATE_BY_KIND[failure["failure"]], options)
    else:
        problem, advice = _fill_in(_TEMPLATE_BY_STATUS.get(status, _UNKNOWN_STATUS), options)
        detail = f"{status}: {detail}" if detail else str(status)
    return f"{options.server_origin} {problem}{f' ({detail})' if detail else ''}; {advice}"


def describe_missed_deadline(retry_causes: Sequence[int | None], options: RoboflowOptions) -> str:
    """Return the message about a missed deadline.

    `retry_causes` are the HTTP statuses that caused retries before the deadline; None for no connection.
    """
    message = f"no answer within {options.deadline} s from {options.server_origin}"
    if not retry_causes:
        return f"{message}; check its log and the network, or increase deadline"
    # inference-sdk retries requests; the status that caused the last retry explains the delay.
    status = retry_causes[-1]
    if status is None:
        return f"{message}, which is not reachable; check that the server is running, and check url"
    problem, advice = _fill_in(_TEMPLATE_BY_STATUS.get(status, _UNKNOWN_STATUS), options)
    return f"{message}, which {problem} ({status}); {advice}"


def describe_invalid_answer(problem: str, options: RoboflowOptions) -> str:
    """Return the message about an invalid answer."""
    question = f"is {options.model_id} a model that detects objects?"
    if options.api == "workflow":
        question = f'is "{options.workflow_output}" the predictions of a model that detects objects?'
    return f"{options.server_origin} sent an invalid answer: {shorten_to_line(problem)}; {question}"


def _fill_in(template: tuple[str, str], options: RoboflowOptions) -> tuple[str, str]:
    """Return failure and advice of a template, with the names of model, workflow and options inserted."""
    problem, advice = template
    model = f"model {options.model_id}"
    names = "model_id"
    if options.api == "workflow":
        model = f"workflow {options.workspace}/{options.workflow_id}"
        names = "workspace and workflow_id"
    return problem.format(model=model, output=options.workflow_output), advice.format(options=names)


def shorten_to_line(text: str) -> str:
    """Return text from a server as one short line of printable characters."""
    characters = (char if char.isprintable() else " " for char in text[: 10 * MAX_DETAIL_LENGTH])
    line = " ".join("".join(characters).split())
    return line if len(line) <= MAX_DETAIL_LENGTH else f"{line[:MAX_DETAIL_LENGTH]}..."


class RoboflowDetector:
    """Detector that sends images to a Roboflow inference server, hosted or self-hosted.

    Args:
        config: Section of the detector in the cell file.
        context: Parts of the cell that the detector uses.
    """

    def __init__(self, config: DetectorConfig, context: DetectorContext) -> None:
        self._options = options = RoboflowOptions.read(config)
        self._min_confidence = config.floor
        self._table_view = context.camera.table_view
        self._lock = threading.Lock()  # The helper process answers one thread at a time.
        self._read_answer = read_output if options.api == "workflow" else read_answer
        server = options.model_dump(include={"url", "model_id", "api", *WORKFLOW_OPTIONS})
        # A proxy cannot reach a server on this computer.
        environment = {**os.environ, "no_proxy": "*"} if options.is_local else os.environ
        self._process = InferenceProcess({**server, "confidence": config.floor}, ApiKey(environment))

    @classmethod
    def from_config(cls, config: DetectorConfig, context: DetectorContext) -> RoboflowDetector:
        """Return the detector of a section of a cell file; raise InputError for a wrong option."""
        return cls(config, context)

    @staticmethod
    def check(config: DetectorConfig, base: Path, all_configs: Mapping[str, DetectorConfig]) -> OptionErrors:
        """Yield each invalid option, with a message."""
        del base, all_configs
        yield from RoboflowOptions.find_errors(config)

    @staticmethod
    def labels(config: DetectorConfig, base: Path) -> tuple[str, ...] | None:
        """Return the class names of the cell that the model can find; None if the options list none."""
        del base
        try:
            options = RoboflowOptions.read(config)
        except InputError:
            return None
        return tuple(options.class_map.get(name, name) for name in options.labels) or None

    def close(self) -> None:
        """End the helper process; a running request fails."""
        self._process.stop()
        with self._lock:
            self._process.close()

    def detect(self, frame: Frame, view: str) -> list[Detection]:
        """Send the regions of a view, or the whole image, to the server, and merge the detections."""
        height, width = frame.image.shape[:2]
        regions = list_regions(view, self._table_view, (width, height))
        if view == "full" and self._options.full == "whole":
            regions = [(0, 0, width, height)]
        with self._lock:
            self._process.wait_until_ready()
            deadline = time.monotonic() + self._options.deadline
            detect = partial(self._detect_in_crop, deadline=deadline)
            return search_regions(frame.image, regions, detect, self._options.class_map)

    def _detect_in_crop(self, crop: NDArray[np.uint8], deadline: float) -> list[Detection]:
        """Return the detections of the server in a crop of a frame, with boxes in pixels of the crop."""
        try:
            message = self._process.request(crop, deadline)
        except NoAnswer as error:
            text = describe_missed_deadline(error.retry_causes, self._options)
            raise DeadlinePassed(text, self._options.deadline) from None
        if "failure" in message:
            raise Unavailable(describe_failure(message, self._options))
        try:
            detections = self._read_answer(message["answer"], (crop.shape[1], crop.shape[0]))
        except (ValueError, RecursionError) as error:
            text = describe_invalid_answer(str(error), self._options)
            raise Unavailable(text) from None
        detections = [detection for detection in detections if detection.confidence >= self._min_confidence]
        return remove_duplicates(sorted(detections, key=lambda detection: -detection.confidence))
