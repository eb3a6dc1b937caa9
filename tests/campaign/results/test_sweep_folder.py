"""Folders of sweeps and comparisons: no database stays open if it cannot be resumed."""

from __future__ import annotations

from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from executive.campaign.results import sweep_folder
from executive.campaign.results.database import ResultsDatabase
from executive.campaign.results.rows import SweepSettings
from executive.errors import InputError


@pytest.fixture
def open_databases(monkeypatch: pytest.MonkeyPatch) -> list[ResultsDatabase]:
    """The databases that are open."""
    databases: list[ResultsDatabase] = []

    class TrackedDatabase(ResultsDatabase):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            databases.append(self)

        def close(self) -> None:
            super().close()
            databases.remove(self)

    monkeypatch.setattr(sweep_folder, "ResultsDatabase", TrackedDatabase)
    return databases


@pytest.fixture(scope="module")
def settings() -> SweepSettings:
    return sweep_folder.make_settings("sort_fruit", range(2), {"cell.kind": "fake"}, {}, None, False)


def test_a_sweep_is_opened_once_and_only_with_its_inputs(
    tmp_path: Path, open_databases: list[ResultsDatabase], settings: SweepSettings
) -> None:
    with closing(sweep_folder.create_database(tmp_path, settings)) as first:
        with pytest.raises(InputError, match="another process executes the sweep"):
            sweep_folder.open_sweep(tmp_path)
        assert open_databases == [first]
    with closing(sweep_folder.open_sweep(tmp_path)) as again:
        assert open_databases == [again]
    (tmp_path / "changed").mkdir()
    sweep_folder.create_database(tmp_path / "changed", replace(settings, inputs_hash="other")).close()
    with pytest.raises(InputError, match=r"or its scene changed after the sweep .*/changed\" began"):
        sweep_folder.open_sweep(tmp_path / "changed")
    assert open_databases == []


def test_a_comparison_is_opened_with_both_sweeps_or_not_at_all(
    tmp_path: Path, open_databases: list[ResultsDatabase], settings: SweepSettings
) -> None:
    databases = sweep_folder.create_comparison([settings, settings], tmp_path)
    folder = databases[0].path.parents[1]
    databases[0].close()
    with pytest.raises(InputError, match=r"another process executes the sweep .*/b/"):
        sweep_folder.open_comparison(folder)
    assert open_databases == [databases[1]]
    databases[1].close()
    both = sweep_folder.open_comparison(folder)
    assert open_databases == both
    for database in both:
        database.close()
