"""The program that talks to a Roboflow inference server: `python -m executive.perception.detectors.roboflow`.

Its argument is JSON: which server, model or workflow, and confidence. On its standard input it gets for every
image a line of JSON with width and height, and the pixels. On its standard output it says a line of JSON for
each, and one when it is ready. The key comes through the environment. It ends with its input, whatever it is
doing.
"""

from __future__ import annotations

import json
import logging
import os
import queue
import sys
import threading
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from executive.perception.detectors.roboflow.key import VARIABLE

if TYPE_CHECKING:
    from inference_sdk import InferenceHTTPClient

LONGEST = 1 << 20
"""Characters of an answer that are handed on; 300 predictions take a twentieth of it."""

Say = Callable[..., None]
"""Says one line of JSON."""


class NoOutput(Exception):
    """A workflow has no output of the name that is asked for; the text names its outputs."""


def main() -> None:
    """Answer until the input ends."""
    say = _mouth()
    images: queue.Queue[NDArray[np.uint8]] = queue.Queue()
    threading.Thread(target=_read, args=(sys.stdin.buffer, images), daemon=True).start()
    try:
        infer = _client(json.loads(sys.argv[1]))
    except Exception as error:
        say(unusable=f"{type(error).__name__}: {error}")
        # The thread that reads the input holds its lock: a regular exit would abort the interpreter.
        os._exit(0)
    logging.getLogger("backoff").addHandler(_Repeats(say))
    logging.getLogger("backoff").setLevel(logging.DEBUG)
    say(ready=True)
    while True:
        _answer(infer, images.get(), say)


def _mouth() -> Say:
    """Return what says lines; whatever else is printed goes to the standard error from now on."""
    out = os.fdopen(os.dup(1), "w", encoding="utf-8")
    os.dup2(2, 1)

    def say(**message: Any) -> None:
        out.write(json.dumps(message) + "\n")
        out.flush()

    return say


def _read(pipe: BinaryIO, images: queue.Queue[NDArray[np.uint8]]) -> None:
    """Put every image into `images`; end the process with the input, though its server may hang."""
    while header := pipe.readline():
        size = json.loads(header)
        shape = size["height"], size["width"], 3
        pixels = pipe.read(shape[0] * shape[1] * shape[2])
        if len(pixels) < shape[0] * shape[1] * shape[2]:
            break
        images.put(np.frombuffer(pixels, np.uint8).reshape(shape))
    os._exit(0)


def _client(setup: dict[str, Any]) -> Callable[[NDArray[np.uint8]], Any]:
    """Return what sends an RGB image to the model or workflow and returns its answer."""
    from inference_sdk import InferenceConfiguration, InferenceHTTPClient

    client = InferenceHTTPClient(setup["url"].rstrip("/"), os.environ.get(VARIABLE, "").strip() or None)
    # The default puts the key into addresses, and those into errors.
    client.configure(
        InferenceConfiguration(confidence_threshold=setup["confidence"], api_key_transport="header")
    )
    if setup["api"] == "v0":
        client.select_api_v0()
    elif setup["api"] == "v1":
        client.select_api_v1()
    # It takes arrays as OpenCV has them: BGR.
    if setup["api"] == "workflow":
        return lambda image: _run_workflow(client, setup, image[..., ::-1])
    return lambda image: client.infer(image[..., ::-1], model_id=setup["model_id"])


def _run_workflow(client: InferenceHTTPClient, setup: dict[str, Any], image: NDArray[np.uint8]) -> Any:
    """Return the output of a workflow that holds the predictions for a BGR image."""
    images = {setup["workflow_input"]: image}
    (outputs,) = client.run_workflow(setup["workspace"], setup["workflow_id"], images=images)
    if setup["workflow_output"] not in outputs:
        raise NoOutput(f"it has: {', '.join(outputs)}")
    return outputs[setup["workflow_output"]]


def _answer(infer: Callable[[NDArray[np.uint8]], Any], image: NDArray[np.uint8], say: Say) -> None:
    """Say what the server says of an image, or why it says nothing."""
    try:
        answer = infer(image)
        if isinstance(answer, dict):
            answer = {key: answer[key] for key in ("image", "predictions") if key in answer}
        text = json.dumps(answer)
    except Exception as error:
        say(**_failure(error))
        return
    if len(text) > LONGEST:
        say(failure="garbled", said=f"an answer of {len(text)} characters")
    else:
        say(answer=answer)


def _failure(error: Exception) -> dict[str, Any]:
    """Return what kind of failure the SDK's exception stands for, and what was said."""
    import socket
    import ssl

    import requests
    from inference_sdk.http import errors as sdk

    if isinstance(error, sdk.HTTPCallErrorError):
        return {"failure": "status", "status": error.status_code, "said": str(error.api_message or "")}
    if isinstance(error, NoOutput):
        return {"failure": "no output", "said": str(error)}
    kinds: tuple[tuple[str, tuple[type[BaseException], ...]], ...] = (
        ("no key", (sdk.APIKeyNotProvided,)),
        ("no model", (sdk.InvalidModelIdentifier, sdk.ModelNotInitializedError)),
        ("no detector", (sdk.ModelTaskTypeNotSupportedError,)),
        ("refused", (ConnectionRefusedError,)),
        ("unknown host", (socket.gaierror,)),
        ("tls", (ssl.SSLError,)),
        ("garbled", (ValueError, LookupError, AttributeError, TypeError, RecursionError)),
        ("lost", (OSError, requests.RequestException, sdk.HTTPClientError)),
    )
    for kind, types in kinds:
        found = next((cause for cause in _causes(error) if isinstance(cause, types)), None)
        if found is not None:
            return {"failure": kind, "said": f"{type(found).__name__}: {found}"}
    return {"failure": "other", "said": f"{type(error).__name__}: {error}"}


def _causes(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an exception and those that led to it, latest first."""
    seen: set[int] = set()
    while error is not None and id(error) not in seen:
        seen.add(id(error))
        yield error
        error = error.__cause__ or error.__context__


class _Repeats(logging.Handler):
    """Says that a server gave no answer and is asked again, which inference-sdk does by itself."""

    def __init__(self, say: Say) -> None:
        super().__init__()
        self._say = say

    def emit(self, record: logging.LogRecord) -> None:
        """Say the status it answered with, None for no connection: the last argument of backoff's record."""
        last = record.args[-1] if isinstance(record.args, tuple) else None
        self._say(again=getattr(last, "status_code", None))


if __name__ == "__main__":
    main()
