"""Whether models can be asked that Roboflow hosts; nothing that comes with the project asks them."""

from __future__ import annotations

import os
import threading
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator, Mapping

from executive.cli.doctor.finding import Finding
from executive.vision.detectors.roboflow.key import VARIABLE, ApiKey
from executive.vision.detectors.roboflow.options import HOSTED

LONGEST = 3.0
"""Time after which a server counts as out of reach [s]."""


def key(environment: Mapping[str, str] = os.environ) -> Iterator[Finding]:
    """Yield whether there is a key, and nothing else of it: this is printed where others may read it."""
    if ApiKey(environment).is_set:
        yield Finding("ok", "key", f"{VARIABLE} is set")
    else:
        yield Finding("note", "key", f"{VARIABLE} is not set", "set it for models that Roboflow hosts")


def server(answers: Callable[[str], bool] | None = None) -> Iterator[Finding]:
    """Yield whether Roboflow's own server answers; it is told nothing."""
    if (answers or answers_in_time)(HOSTED):
        yield Finding("ok", "roboflow", f"{HOSTED} answers")
    else:
        yield Finding(
            "note", "roboflow", f"{HOSTED} does not answer within {LONGEST:.0f} s",
            "see to the network for models that Roboflow hosts; nothing else needs it",
        )  # fmt: skip


def answers_in_time(address: str, longest: float = LONGEST) -> bool:
    """Tell whether a server gives any answer at all in so much time [s]."""
    answered: list[bool] = []

    def ask() -> None:
        try:
            urllib.request.urlopen(address, timeout=longest).close()
        except urllib.error.HTTPError:
            pass  # Whatever it thinks of the question, it is there.
        except OSError:
            return
        answered.append(True)

    # Looking up a name has no time limit of its own.
    asking = threading.Thread(target=ask, name="asking roboflow", daemon=True)
    asking.start()
    asking.join(longest)
    return bool(answered)
