"""What a model behind a Roboflow inference server needs to know, and what is wrong with it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal
from urllib.parse import urlsplit

from pydantic import Field

from executive.cell_config import DetectorConfig, Section
from executive.vision.detectors.options import wrong_class_map, wrong_options
from executive.vision.detectors.roboflow.key import VARIABLE

HOSTED = "https://serverless.roboflow.com"
"""Where Roboflow serves models itself."""
SECRETS = ("key", "token", "secret", "password", "authorization")
"""Parts of the names of options that somebody may have put a secret into."""


class RoboflowOptions(Section):
    """What a detector of kind `roboflow` has to know beside what every detector has."""

    model_id: str = Field(min_length=1)
    """The model, as the server knows it: `project/version`, or a name of inference-sdk's: `rfdetr-nano`."""
    url: str = HOSTED
    """Where the inference server is."""
    api: Literal["auto", "v0", "v1"] = "auto"
    """How to talk to it: `v0`, one request to `/project/version`; `v1`, as servers of one's own do; `auto`,
    as inference-sdk decides by the address."""
    class_map: dict[str, str] = Field(default_factory=dict)
    """From the model's class names to the cell's, where they differ."""
    labels: tuple[str, ...] = ()
    """The model's class names, so that `check` can tell which classes it does not know."""
    deadline: float = Field(1.0, gt=0, le=60)
    """Longest time for an answer, by the wall clock and the run's [s]."""
    full: Literal["whole", "tiles"] = "whole"
    """What is sent of a whole frame: `whole`, all of it; `tiles`, pieces of the table view's size in turn."""

    @property
    def host(self) -> str:
        """The server, without whatever else an address may hold."""
        parts = urlsplit(self.url)
        return f"{parts.scheme}://{parts.netloc.rpartition('@')[2]}"


def wrong_roboflow(config: DetectorConfig) -> Iterator[tuple[str, str]]:
    """Yield every option because of which the detector could not be built, with a sentence."""
    wrong = list(wrong_options(RoboflowOptions, config))
    for option, sentence in wrong:
        if any(part in option.lower() for part in SECRETS):
            sentence = (
                f'"{option}" does not belong in a cell file, where everybody may read it; '
                f"delete it there and set the environment variable {VARIABLE}"
            )
        yield option, sentence
    if wrong:
        return
    options = RoboflowOptions.model_validate(config.options)
    yield from _wrong_url(options.url)
    if any(mark in options.model_id for mark in "?&#= "):
        yield "model_id", "model_id must be a name or project/version alone, without ?, &, #, = or a space"
        return
    parts = options.model_id.split("/")
    if options.api == "v0" and (len(parts) > 2 or not all(parts)):
        yield (
            "model_id",
            f"model_id must be project/version for v0, or a name such as rfdetr-nano, "
            f'not "{options.model_id}"',
        )
    if options.labels:
        yield from wrong_class_map(config, options.class_map, options.labels)


def _wrong_url(url: str) -> Iterator[tuple[str, str]]:
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
