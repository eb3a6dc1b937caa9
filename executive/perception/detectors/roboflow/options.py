"""What a model behind a Roboflow inference server needs to know, and what is wrong with it."""

from __future__ import annotations

from typing import Literal
from urllib.parse import urlsplit

from pydantic import Field

from executive.cell.config import DetectorConfig, Section
from executive.perception.detectors.roboflow.key import VARIABLE
from executive.perception.detectors.setting import OptionFaults, find_wrong_class_map, find_wrong_options

HOSTED = "https://serverless.roboflow.com"
"""Where Roboflow serves models itself."""
SECRET_WORDS = ("key", "token", "secret", "password", "authorization")
"""Parts of the names of options that somebody may have put a secret into."""
WORKFLOW_OPTIONS = ("workspace", "workflow_id", "workflow_input", "workflow_output")
"""Options that are used by `api: workflow` alone."""
FORBIDDEN_CHARACTERS = "?&#= "
"""Characters that would change the address of a request."""


class RoboflowOptions(Section):
    """What a detector of kind `roboflow` has to know beside what every detector has."""

    model_id: str = ""
    """The model, as the server knows it: `project/version`, or a name of inference-sdk's: `rfdetr-nano`. Not
    used by `api: workflow`."""
    url: str = HOSTED
    """Where the inference server is."""
    api: Literal["auto", "v0", "v1", "workflow"] = "auto"
    """How to talk to it: `v0`, one request to `/project/version`; `v1`, as servers of one's own do; `auto`,
    one of these two, as inference-sdk decides by the address; `workflow`, a workflow of a workspace."""
    workspace: str = ""
    """Workspace of the workflow, as in its address."""
    workflow_id: str = ""
    """The workflow, as in its address."""
    workflow_input: str = Field("image", min_length=1)
    """The input of the workflow that takes an image."""
    workflow_output: str = Field("predictions", min_length=1)
    """The output of the workflow that holds the predictions of an object detection model."""
    class_map: dict[str, str] = Field(default_factory=dict)
    """From the model's class names to the cell's, where they differ."""
    labels: tuple[str, ...] = ()
    """The model's class names, so that `check` can tell which classes it does not know."""
    deadline: float = Field(1.0, gt=0, le=60)
    """Longest time for all answers about one frame, by the wall clock and the run's [s]. The deadline covers
    the requests for every image, and those that inference-sdk repeats after the statuses 429, 503 and 504."""
    full: Literal["whole", "tiles"] = "whole"
    """Images of a look at everything that the camera sees: `whole`, the frame; `tiles`, one after the other,
    pieces of the table view's size that overlap by a quarter or more (9 in a frame of 640 x 480 pixels with a
    table view of 256 x 256). A look at the table is one image. An image takes one request with `v0` and
    `workflow`. It takes two with `v1` (the list of loaded models; the image), and three as long as the server
    has not loaded the model."""

    @property
    def host(self) -> str:
        """The server, without whatever else an address may hold."""
        parts = urlsplit(self.url)
        return f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}"

    @property
    def subject(self) -> str:
        """The model or the workflow, for sentences."""
        if self.api == "workflow":
            return f"workflow {self.workspace}/{self.workflow_id}"
        return f"model {self.model_id}"

    @property
    def subject_options(self) -> str:
        """The options that name the model or the workflow, for sentences."""
        return "workspace and workflow_id" if self.api == "workflow" else "model_id"


def find_wrong_roboflow_options(config: DetectorConfig) -> OptionFaults:
    """Yield every option because of which the detector could not be built, with a sentence."""
    wrong = list(find_wrong_options(RoboflowOptions, config))
    for option, sentence in wrong:
        if any(part in option.lower() for part in SECRET_WORDS):
            sentence = (
                f'"{option}" does not belong in a cell file, where everybody may read it; '
                f"delete it there and set the environment variable {VARIABLE}"
            )
        yield option, sentence
    if wrong:
        return
    options = RoboflowOptions.model_validate(config.options)
    yield from _wrong_url(options.url)
    yield from _wrong_workflow(options) if options.api == "workflow" else _wrong_model(options)
    if options.labels:
        yield from find_wrong_class_map(config, options.class_map, options.labels)


def _wrong_model(options: RoboflowOptions) -> OptionFaults:
    """Yield the option because of which no model can be asked, with a sentence."""
    given = [name for name in WORKFLOW_OPTIONS if name in options.model_fields_set]
    parts = options.model_id.split("/")
    if given:
        names = ", ".join(given)
        yield given[0], f"api: {options.api} does not use {names}; write api: workflow, or delete {names}"
    elif not options.model_id:
        yield "model_id", f"api: {options.api} needs model_id: project/version, or a name such as rfdetr-nano"
    elif any(mark in options.model_id for mark in FORBIDDEN_CHARACTERS):
        yield "model_id", "model_id must be a name or project/version alone, without ?, &, #, = or a space"
    elif options.api == "v0" and (len(parts) > 2 or not all(parts)):
        yield (
            "model_id",
            f"model_id must be project/version for v0, or a name such as rfdetr-nano, "
            f'not "{options.model_id}"',
        )


def _wrong_workflow(options: RoboflowOptions) -> OptionFaults:
    """Yield the option because of which no workflow can be run, with a sentence."""
    names = {"workspace": options.workspace, "workflow_id": options.workflow_id}
    for option, name in names.items():
        if not name:
            yield option, f"api: workflow needs workspace and workflow_id; {option} is missing"
        elif any(mark in name for mark in f"{FORBIDDEN_CHARACTERS}/"):
            yield option, f"{option} must be a name alone, without /, ?, &, #, = or a space"


def _wrong_url(url: str) -> OptionFaults:
    """Yield a sentence if `url` is no address of a server alone."""
    try:
        parts = urlsplit(url)
        known = parts.scheme in ("http", "https") and bool(parts.hostname) and parts.port != 0
    except ValueError:
        known = False
    if not known:
        yield "url", "url must be an address such as http://127.0.0.1:9001 or https://serverless.roboflow.com"
    elif "@" in parts.netloc or parts.query or parts.fragment:
        yield "url", f"url must hold no user, query or fragment; a key goes into the variable {VARIABLE}"
