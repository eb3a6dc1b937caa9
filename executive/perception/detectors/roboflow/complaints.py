"""Sentences about a server that gave no usable answer: what happened, where, and what to look at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from executive.perception.detectors.roboflow.key import VARIABLE
from executive.perception.detectors.roboflow.options import RoboflowOptions

MAX_QUOTED = 100
"""Characters of a server's own words that are repeated."""

_KEY = f"set {VARIABLE} to a key that may use it"
_BY_STATUS: Mapping[int, tuple[str, str]] = {
    400: ("could not use the request", "check {options} and api"),
    401: ("does not accept the key", _KEY),
    402: ("wants to be paid", f"look at the plan of the account that {VARIABLE} belongs to"),
    403: ("does not accept the key", _KEY),
    404: ("has no {subject}", "check {options} and url"),
    413: ("finds the image too large", "give the camera a smaller table_view, or set full: tiles"),
    429: ("has been asked too often", "ask less often, or look at the plan of the account"),
    500: ("has an error of its own", "look at its log"),
    502: ("has lost the server behind it", "is that running?"),
    503: ("is not ready, or cannot load {subject}", "look at its log, and check {options}"),
}
_UNKNOWN = ("gave no answer", "look at its log")
_BY_KIND: Mapping[str, tuple[str, str]] = {
    "no key": ("wants a key", f"set {VARIABLE}"),
    "no model": ("has no {subject}", "check {options}"),
    "no detector": ("has a {subject} that detects no objects", "check {options}"),
    "no output": ('ran {subject}, which has no output "{output}"', "check workflow_output"),
    "refused": ("refused the connection", "is it running, and is url right?"),
    "unknown host": ("is not known by this name", "check url and the network"),
    "tls": ("cannot be trusted (TLS)", "check url, its certificate and the clock"),
    "lost": ("broke off", "look at its log and the network"),
    "garbled": ("answered with something that inference-sdk cannot read", "is it an inference server?"),
    "other": ("could not be asked", "look at what inference-sdk says"),
}


def describe_failure(failure: Mapping[str, Any], options: RoboflowOptions) -> str:
    """Return the sentence about a failure that the helper tells of."""
    said = one_line(str(failure.get("said", "")))
    status = failure.get("status")
    if status is None:
        what, advice = _worded(_BY_KIND[failure["failure"]], options)
    else:
        what, advice = _worded(_BY_STATUS.get(status, _UNKNOWN), options)
        said = f"{status}: {said}" if said else str(status)
    return f"{options.host} {what}{f' ({said})' if said else ''}; {advice}"


def describe_delay(repeats: Sequence[int | None], options: RoboflowOptions) -> str:
    """Return the sentence about a deadline that has passed."""
    sentence = f"no answer within {options.deadline} s from {options.host}"
    if not repeats:
        return f"{sentence}; look at its log and the network, or give it a longer deadline"
    # inference-sdk asks again by itself; what the server has said is more than that it is late.
    status = repeats[-1]
    if status is None:
        return f"{sentence}, to which there was no connection; is it running, and is url right?"
    what, advice = _worded(_BY_STATUS.get(status, _UNKNOWN), options)
    return f"{sentence}, which {what} ({status}); {advice}"


def describe_invalid_answer(problem: str, options: RoboflowOptions) -> str:
    """Return the sentence about an answer that cannot be right."""
    question = f"is {options.model_id} a model that detects objects?"
    if options.api == "workflow":
        question = f'is "{options.workflow_output}" the predictions of a model that detects objects?'
    return f"{options.host} gave an answer that cannot be right: {one_line(problem)}; {question}"


def _worded(sentence: tuple[str, str], options: RoboflowOptions) -> tuple[str, str]:
    """Return what happened and what to do, with the names of model, workflow and options."""
    what, advice = sentence
    what = what.format(subject=options.subject, output=options.workflow_output)
    return what, advice.format(options=options.subject_options)


def one_line(text: str) -> str:
    """Return somebody else's words as one short line of printable characters."""
    line = " ".join("".join(c if c.isprintable() else " " for c in text[: 10 * MAX_QUOTED]).split())
    return line if len(line) <= MAX_QUOTED else f"{line[:MAX_QUOTED]}..."
