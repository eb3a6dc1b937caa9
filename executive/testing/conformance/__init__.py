"""Conformance checks: rules of the executive for every skill, applied by test runs of the skill."""

from __future__ import annotations

from executive.testing.conformance.conformance_check import list_conformance_checks
from executive.testing.conformance.situations import SkillScene

__all__ = ["SkillScene", "list_conformance_checks"]
