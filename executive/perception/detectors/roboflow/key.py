"""API key of a user of the hosted service."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping

KEY_VARIABLE = "ROBOFLOW_API_KEY"
"""Environment variable that holds the API key, its only source."""
MIN_KEY_LENGTH = 8
"""Smallest length of a secret key; shorter keys are placeholders for servers that accept any key."""
HIDDEN = "***"
"""Replacement of the key in texts."""


class ApiKey:
    """API key from the environment; only the attribute `environment` reveals the text of the key."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self.environment = dict(environment)
        """Environment variables of the process that uses the key."""
        self._key = environment.get(KEY_VARIABLE, "").strip()

    @property
    def is_set(self) -> bool:
        """Return True if the environment contains a key."""
        return bool(self._key)

    def redact(self, text: str) -> str:
        """Return `text`, plain or JSON, without the key."""
        if len(self._key) < MIN_KEY_LENGTH:
            return text
        return text.replace(self._key, HIDDEN).replace(json.dumps(self._key)[1:-1], HIDDEN)

    def __repr__(self) -> str:
        return f"ApiKey({HIDDEN if self.is_set else ''})"
