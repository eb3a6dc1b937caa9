"""Options of the detector kind `roboflow`, and their validation."""

from __future__ import annotations

import re
from typing import Literal
from urllib.parse import urlsplit
from urllib.request import getproxies

from pydantic import Field

from executive.cell.config import DetectorConfig
from executive.perception.detectors.options import DetectorOptions, OptionErrors, find_class_map_errors
from executive.perception.detectors.roboflow.key import KEY_VARIABLE

HOSTED_URL = "https://serverless.roboflow.com"
"""Address of Roboflow's hosted server."""
SECRET_WORDS = ("key", "token", "secret", "password", "authorization")
"""Substrings of the names of unknown options whose values are probably secrets."""
WORKFLOW_OPTIONS = ("workspace", "workflow_id", "workflow_input", "workflow_output")
"""Options that only `api: workflow` uses."""
FORBIDDEN_CHARACTERS = "?&#= "
"""Characters that are not allowed in names, because they would change the URL of a request."""


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

    @property
    def model_or_workflow(self) -> str:
        """Kind and name of the model or the workflow, for messages."""
        if self.api == "workflow":
            return f"workflow {self.workspace}/{self.workflow_id}"
        return f"model {self.model_id}"

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
            yield from find_class_map_errors(config, options.class_map, options.labels)


def _check_model(options: RoboflowOptions) -> OptionErrors:
    """Yield the first invalid option for requests to a model, with a message."""
    api, model_id, parts = options.api, options.model_id, options.model_id.split("/")
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
    """Yield each invalid option for requests to a workflow, with a message."""
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
