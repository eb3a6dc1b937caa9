"""Messages about failures of an inference server: server, failure, and advice."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from executive.perception.detectors.roboflow.key import KEY_VARIABLE
from executive.perception.detectors.roboflow.server_options import RoboflowOptions

MAX_QUOTATION_LENGTH = 100
"""Maximum number of characters that are quoted from a message of a server."""

_KEY_ADVICE = f"set {KEY_VARIABLE} to a key that may use it"
_TEMPLATE_BY_STATUS: Mapping[int, tuple[str, str]] = {
    400: ("could not use the request", "check {options} and api"),
    401: ("does not accept the key", _KEY_ADVICE),
    402: ("wants to be paid", f"look at the plan of the account that {KEY_VARIABLE} belongs to"),
    403: ("does not accept the key", _KEY_ADVICE),
    404: ("has no {subject}", "check {options} and url"),
    413: ("finds the image too large", "give the camera a smaller table_view, or set full: tiles"),
    429: ("has been asked too often", "ask less often, or look at the plan of the account"),
    500: ("has an error of its own", "look at its log"),
    502: ("has lost the server behind it", "is that running?"),
    503: ("is not ready, or cannot load {subject}", "look at its log, and check {options}"),
}
_UNKNOWN_STATUS = ("gave no answer", "look at its log")
_TEMPLATE_BY_KIND: Mapping[str, tuple[str, str]] = {
    "no key": ("wants a key", f"set {KEY_VARIABLE}"),
    "no model": ("has no {subject}", "check {options}"),
    "no detector": ("has a {subject} that detects no objects", "check {options}"),
    "no output": ('ran {subject}, which has no output "{output}"', "check workflow_output"),
    "refused": ("refused the connection", "is it running, and is url right?"),
    "unknown host": ("is not known by this name", "check url and the network"),
    "tls": ("cannot be trusted (TLS)", "check url, its certificate and the clock"),
    "lost": ("broke off", "look at its log and the network"),
    "invalid": ("answered with something that inference-sdk cannot read", "is it an inference server?"),
    "other": ("could not be asked", "look at what inference-sdk says"),
}


def describe_failure(failure: Mapping[str, Any], options: RoboflowOptions) -> str:
    """Return the message about a failure that the helper process reports."""
    detail = shorten_to_line(str(failure.get("detail", "")))
    status = failure.get("status")
    if status is None:
        event, advice = _fill_in(_TEMPLATE_BY_KIND[failure["failure"]], options)
    else:
        event, advice = _fill_in(_TEMPLATE_BY_STATUS.get(status, _UNKNOWN_STATUS), options)
        detail = f"{status}: {detail}" if detail else str(status)
    return f"{options.host} {event}{f' ({detail})' if detail else ''}; {advice}"


def describe_delay(retry_causes: Sequence[int | None], options: RoboflowOptions) -> str:
    """Return the message about a missed deadline.

    Args:
        retry_causes: HTTP statuses that caused retries before the deadline; None for no connection.
        options: Options of the detector.
    """
    message = f"no answer within {options.deadline} s from {options.host}"
    if not retry_causes:
        return f"{message}; look at its log and the network, or give it a longer deadline"
    # inference-sdk retries requests; the status that caused the last retry explains the delay.
    status = retry_causes[-1]
    if status is None:
        return f"{message}, to which there was no connection; is it running, and is url right?"
    event, advice = _fill_in(_TEMPLATE_BY_STATUS.get(status, _UNKNOWN_STATUS), options)
    return f"{message}, which {event} ({status}); {advice}"


def describe_invalid_answer(problem: str, options: RoboflowOptions) -> str:
    """Return the message about an invalid answer."""
    question = f"is {options.model_id} a model that detects objects?"
    if options.api == "workflow":
        question = f'is "{options.workflow_output}" the predictions of a model that detects objects?'
    return f"{options.host} gave an answer that cannot be right: {shorten_to_line(problem)}; {question}"


def _fill_in(template: tuple[str, str], options: RoboflowOptions) -> tuple[str, str]:
    """Return failure and advice of a template, with the names of model, workflow and options inserted."""
    event, advice = template
    event = event.format(subject=options.subject, output=options.workflow_output)
    return event, advice.format(options=options.subject_options)


def shorten_to_line(text: str) -> str:
    """Return text from a server as one short line of printable characters."""
    line = " ".join("".join(c if c.isprintable() else " " for c in text[: 10 * MAX_QUOTATION_LENGTH]).split())
    return line if len(line) <= MAX_QUOTATION_LENGTH else f"{line[:MAX_QUOTATION_LENGTH]}..."
