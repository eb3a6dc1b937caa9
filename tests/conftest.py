"""Fixtures that many tests share."""

from __future__ import annotations

from pathlib import Path

import pytest

from executive.testing.fake_cell import FakeCell


@pytest.fixture
def fake() -> FakeCell:
    """A fake cell with an empty table."""
    return FakeCell()


@pytest.fixture(scope="session")
def missions() -> Path:
    """The folder of shipped missions."""
    return Path(__file__).parent.parent / "missions"
