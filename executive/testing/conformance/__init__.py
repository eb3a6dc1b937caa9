"""Checks that any skill must pass, generated from its declarations."""

from __future__ import annotations

from executive.testing.conformance.check import conformance
from executive.testing.conformance.situations import Stage

__all__ = ["Stage", "conformance"]
