"""Messages about failures of an inference server. Each message names server, failure, and advice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from executive.perception.detectors.roboflow.key import KEY_VARIABLE
from executive.perception.detectors.roboflow.server_options import RoboflowOptions

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
    problem = problem.format(model=options.model_or_workflow, output=options.workflow_output)
    names = "workspace and workflow_id" if options.api == "workflow" else "model_id"
    return problem, advice.format(options=names)


def shorten_to_line(text: str) -> str:
    """Return text from a server as one short line of printable characters."""
    characters = (char if char.isprintable() else " " for char in text[: 10 * MAX_DETAIL_LENGTH])
    line = " ".join("".join(characters).split())
    return line if len(line) <= MAX_DETAIL_LENGTH else f"{line[:MAX_DETAIL_LENGTH]}..."
