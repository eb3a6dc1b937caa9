"""The tables of a sweep as Parquet files."""

from __future__ import annotations

import sys
from contextlib import closing
from pathlib import Path

import pytest
from test_database import RECORD, SETTINGS, SKILL

from executive.campaign.results.database import ResultsDatabase
from executive.campaign.results.export import check_pyarrow_installed, export_tables
from executive.errors import InputError


def test_a_parquet_file_contains_each_table(tmp_path: Path) -> None:
    parquet = pytest.importorskip("pyarrow.parquet")
    with closing(ResultsDatabase(tmp_path / "a", SETTINGS)) as database:
        export_tables(database, tmp_path / "none")
        database.append(RECORD)
        export_tables(database, tmp_path / "out")
    (run,) = parquet.read_table(tmp_path / "out" / "runs.parquet").to_pylist()
    assert (run["run_index"], run["variant"], run["audit_agrees"], run["robot_time_s"]) == (
        3,
        '{"speed": "1"}',
        0,
        0.1 + 0.2,
    )
    assert parquet.read_table(tmp_path / "out" / "skills.parquet").to_pylist() == [vars(SKILL)]
    empty = parquet.read_table(tmp_path / "none" / "runs.parquet")
    assert (empty.num_rows, empty.schema.field("ticks").type) == (0, "int64")


def test_a_missing_package_is_explained(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match=r'--export needs pyarrow; .* pip install "executive\[export\]"'):
        check_pyarrow_installed()
