"""The secret that the hosted service knows a user by."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping

VARIABLE = "ROBOFLOW_API_KEY"
"""The environment variable that holds it; it is read from nowhere else."""
MIN_KEY_LENGTH = 8
"""Shorter ones are stand-ins for servers that want some key, whatever it is; no secrets."""
HIDDEN = "***"


class ApiKey:
    """The key as the environment has it; its text comes out nowhere but in `environment`."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self.environment = dict(environment)
        """What the process that uses the key gets."""
        self._key = environment.get(VARIABLE, "").strip()

    @property
    def is_set(self) -> bool:
        """Tell whether there is one."""
        return bool(self._key)

    def redact(self, text: str) -> str:
        """Return `text`, plain or JSON, without the key."""
        if len(self._key) < MIN_KEY_LENGTH:
            return text
        return text.replace(self._key, HIDDEN).replace(json.dumps(self._key)[1:-1], HIDDEN)

    def __repr__(self) -> str:
        return f"ApiKey({HIDDEN if self.is_set else ''})"
