"""API key of a user of Roboflow's hosted service."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping

KEY_VARIABLE = "ROBOFLOW_API_KEY"
"""Environment variable with the API key, the only source of the key."""
MIN_KEY_LENGTH = 8
"""Minimum length of a secret key; shorter keys are placeholders for servers that accept any key."""
REDACTED_KEY = "***"
"""Text that replaces the key in messages."""


class ApiKey:
    """API key from the environment; only the attribute `environment` contains the key as text."""

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        self.environment = dict(environment)
        """Environment variables of the process that uses the key."""
        self._key = environment.get(KEY_VARIABLE, "").strip()

    @property
    def is_set(self) -> bool:
        """True if the environment contains a key."""
        return bool(self._key)

    def redact(self, text: str) -> str:
        """Return `text`, plain or JSON, without the key."""
        if len(self._key) < MIN_KEY_LENGTH:
            return text
        return text.replace(self._key, REDACTED_KEY).replace(json.dumps(self._key)[1:-1], REDACTED_KEY)

    def __repr__(self) -> str:
        return f"ApiKey({REDACTED_KEY if self.is_set else ''})"
