"""Checks that any skill must pass, generated from what it declares."""

from __future__ import annotations

from executive.testing.conformance.checks import conformance
from executive.testing.conformance.stage import Stage

__all__ = ["Stage", "conformance"]
