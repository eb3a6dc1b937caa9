from __future__ import annotations

import pytest
from ledger_bench import Bench


@pytest.fixture
def bench() -> Bench:
    return Bench()
