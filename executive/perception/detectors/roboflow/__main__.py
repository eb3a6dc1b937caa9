"""Client program of a Roboflow inference server: `python -m executive.perception.detectors.roboflow`.

The argument is JSON with the server, the model or workflow, and the minimum confidence. An environment
variable contains the API key. On the standard input, an image is a line of JSON with width and height,
followed by the pixels. The standard output contains one JSON message per line: a message when the program is
ready, one for each retry, and one answer per image. The program exits at the end of its input.
"""

from __future__ import annotations

import io
import json
import logging
import os
import queue
import socket
import ssl
import sys
import threading
import zlib
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from executive.perception.detectors.roboflow.inference_process import KEY_VARIABLE

MAX_ANSWER_LENGTH = 1 << 20
"""Maximum number of characters of an answer, about 20 times the length of 300 predictions."""
MAX_BODY_SIZE = 8 << 20
"""Maximum size of the body of an HTTP response [byte], compressed or not; workflows also return images."""
MAX_DETAIL_LENGTH = 10_000
"""Maximum number of characters of the message of an error."""

WriteMessage = Callable[..., None]
"""Function that writes its keyword arguments as one line of JSON."""
InferenceFunction = Callable[[NDArray[np.uint8]], Any]
"""Function that sends an RGB image `(H, W, 3)` to the server and returns the answer."""


class MissingOutput(Exception):
    """A workflow lacks the requested output; the message lists its outputs."""


def main() -> None:
    """Answer each image of the standard input until the input ends."""
    write = _open_output()
    images: queue.Queue[NDArray[np.uint8]] = queue.Queue()
    threading.Thread(target=_read_images, args=(sys.stdin.buffer, images), daemon=True).start()
    try:
        infer = _make_inference_function(json.loads(sys.argv[1]))
    except Exception as error:
        write(setup_error=f"{type(error).__name__}: {error}")
        # A normal exit would abort the interpreter, because the reading thread holds the lock of the input.
        os._exit(0)
    logging.getLogger("backoff").addFilter(partial(_report_retry, write))
    logging.getLogger("backoff").setLevel(logging.DEBUG)
    write(ready=True)
    while True:
        _process_image(infer, images.get(), write)


def _open_output() -> WriteMessage:
    """Return a function that writes to the standard output; redirect all other output to standard error."""
    output = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())

    def write(**message: Any) -> None:
        output.write(json.dumps(message) + "\n")
        output.flush()

    return write


def _read_images(pipe: BinaryIO, images: queue.Queue[NDArray[np.uint8]]) -> None:
    """Put each image into `images`; exit the process at the end of the input, even during a request."""
    while header := pipe.readline():
        size = json.loads(header)
        shape = size["height"], size["width"], 3
        pixels = pipe.read(shape[0] * shape[1] * shape[2])
        if len(pixels) < shape[0] * shape[1] * shape[2]:
            break
        images.put(np.frombuffer(pixels, np.uint8).reshape(shape))
    os._exit(0)


def _make_inference_function(settings: dict[str, Any]) -> InferenceFunction:
    # The import takes 2 s, and the executive reports its errors.
    from inference_sdk import InferenceConfiguration, InferenceHTTPClient

    _bound_responses(settings["url"])
    key = os.environ.get(KEY_VARIABLE, "").strip() or None
    client = InferenceHTTPClient(settings["url"].rstrip("/"), key)
    # By default, inference-sdk puts the key into URLs, and the URLs into error messages.
    confidence = settings["confidence"]
    client.configure(InferenceConfiguration(confidence_threshold=confidence, api_key_transport="header"))
    if settings["api"] == "v0":
        client.select_api_v0()
    elif settings["api"] == "v1":
        client.select_api_v1()

    # inference-sdk expects the channel order of OpenCV: BGR.
    def infer(image: NDArray[np.uint8]) -> Any:
        if settings["api"] != "workflow":
            return client.infer(image[..., ::-1], model_id=settings["model_id"])
        images = {settings["workflow_input"]: image[..., ::-1]}
        (outputs,) = client.run_workflow(settings["workspace"], settings["workflow_id"], images=images)
        if settings["workflow_output"] not in outputs:
            raise MissingOutput(f"the outputs are {', '.join(outputs)}")
        return outputs[settings["workflow_output"]]

    return infer


def _bound_responses(url: str) -> None:
    """Limit all HTTP responses in this process to `MAX_BODY_SIZE`, and all requests to the server at `url`.

    inference-sdk uses the library requests, which reads responses of any size, and follows redirects to any
    server; afterwards, such a request raises ValueError.
    """
    import urllib3
    from requests.adapters import HTTPAdapter

    server = urllib3.connection_from_url(url)
    send = HTTPAdapter.send

    def send_within_limits(adapter: HTTPAdapter, request: Any, **options: Any) -> Any:
        if not server.is_same_host(request.url):
            raise ValueError(f"a redirect to {request.url}, another server")
        request.headers["Accept-Encoding"] = "gzip"
        response = send(adapter, request, **{**options, "stream": True})
        try:
            body = _read_body(response.raw)
        finally:
            response.close()
        response.raw = io.BytesIO(body)
        response.encoding = "utf-8"  # The encoding of JSON; the detection of another one would take long.
        return response

    HTTPAdapter.send = send_within_limits  # type: ignore[assignment, method-assign]


def _read_body(response: Any) -> bytearray | bytes:
    """Return the decompressed body of a response of urllib3; raise ValueError above `MAX_BODY_SIZE`."""
    body = bytearray()
    while chunk := response.read(1 << 16, decode_content=False):
        body += chunk
        if len(body) > MAX_BODY_SIZE:
            raise ValueError(f"an answer of more than {MAX_BODY_SIZE} bytes")
    if response.headers.get("Content-Encoding", "identity") == "identity":
        return body
    decoder = zlib.decompressobj(wbits=zlib.MAX_WBITS | 32)  # The number 32 selects the format by its header.
    content = decoder.decompress(body, MAX_BODY_SIZE)
    if not decoder.eof:
        raise ValueError(f"an answer of more than {MAX_BODY_SIZE} bytes, or an incomplete one")
    return content


def _process_image(infer: InferenceFunction, image: NDArray[np.uint8], write: WriteMessage) -> None:
    """Send an image to the server, and write the answer or the failure."""
    try:
        answer = infer(image)
        if isinstance(answer, dict):
            answer = {key: answer[key] for key in ("image", "predictions") if key in answer}
        text = json.dumps(answer)
    except Exception as error:
        failure = _describe_error(error)
        write(**{**failure, "detail": failure["detail"][:MAX_DETAIL_LENGTH]})
        return
    if len(text) > MAX_ANSWER_LENGTH:
        write(failure="invalid", detail=f"an answer of {len(text)} characters")
    else:
        write(answer=answer)


def _describe_error(error: Exception) -> dict[str, Any]:
    """Return the kind of failure and the message of an exception of inference-sdk."""
    # Both packages are installed with inference-sdk, whose import has succeeded.
    import requests
    import urllib3
    from inference_sdk.http import errors as sdk_errors

    if isinstance(error, sdk_errors.HTTPCallErrorError):
        return {"failure": "status", "status": error.status_code, "detail": str(error.api_message or "")}
    if isinstance(error, MissingOutput):
        return {"failure": "no output", "detail": str(error)}
    failures: tuple[tuple[str, tuple[type[BaseException], ...]], ...] = (
        ("no key", (sdk_errors.APIKeyNotProvided,)),
        ("no model", (sdk_errors.InvalidModelIdentifier, sdk_errors.ModelNotInitializedError)),
        ("no detector", (sdk_errors.ModelTaskTypeNotSupportedError,)),
        ("refused", (ConnectionRefusedError,)),
        ("unknown host", (socket.gaierror,)),
        ("tls", (ssl.SSLError,)),
        ("invalid", (ValueError, LookupError, AttributeError, TypeError, RecursionError, zlib.error)),
        (
            "lost",
            (OSError, requests.RequestException, urllib3.exceptions.HTTPError, sdk_errors.HTTPClientError),
        ),
    )
    for failure, exception_types in failures:
        for cause in _iterate_causes(error):
            if isinstance(cause, exception_types):
                return {"failure": failure, "detail": f"{type(cause).__name__}: {cause}"}
    return {"failure": "other", "detail": f"{type(error).__name__}: {error}"}


def _iterate_causes(error: BaseException | None) -> Iterator[BaseException]:
    """Yield an exception and its chain of causes, latest first."""
    visited_ids: set[int] = set()
    while error is not None and id(error) not in visited_ids:
        visited_ids.add(id(error))
        yield error
        error = error.__cause__ or error.__context__


def _report_retry(write: WriteMessage, record: logging.LogRecord) -> bool:
    """Write the HTTP status that caused a retry by inference-sdk, None without a connection; log nothing."""
    cause = record.args[-1] if isinstance(record.args, tuple) else None
    write(retry_status=getattr(cause, "status_code", None))
    return False


if __name__ == "__main__":
    main()
