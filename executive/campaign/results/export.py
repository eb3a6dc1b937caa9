"""Export of the tables of a sweep to Parquet files."""

from __future__ import annotations

from pathlib import Path

from executive.campaign.results.database import ResultsDatabase
from executive.campaign.results.tables import ITEMS, RUNS, SKILLS, RowT, Table
from executive.errors import InputError
from executive.record.run_directory import convert_os_errors


def check_pyarrow_installed() -> None:
    """Check that `pyarrow`, which writes Parquet files, is installed.

    Raises:
        InputError: The package is not installed.
    """
    try:
        import pyarrow  # noqa: F401
    except ImportError as error:
        advice = 'install the extra: uv sync --extra export, or pip install "executive[export]"'
        raise InputError(f"--export needs pyarrow; {advice}") from error


def export_tables(database: ResultsDatabase, folder: Path) -> None:
    """Write the files `runs.parquet`, `items.parquet` and `skills.parquet` into a folder.

    Raises:
        InputError: A file cannot be written.
    """
    with convert_os_errors(f'write the tables to "{folder}"', "name another folder with --export DIR"):
        folder.mkdir(parents=True, exist_ok=True)
        _write(RUNS, database, folder)
        _write(ITEMS, database, folder)
        _write(SKILLS, database, folder)


def _write(table: Table[RowT], database: ResultsDatabase, folder: Path) -> None:
    """Write a table of the database to a file."""
    import pyarrow
    from pyarrow import parquet

    types = {"INTEGER": pyarrow.int64(), "REAL": pyarrow.float64(), "TEXT": pyarrow.string()}
    schema = pyarrow.schema([(column.name, types[column.sql_type]) for column in table.columns])
    rows = [dict(zip(schema.names, table.encode(row), strict=True)) for row in database.read(table)]
    content = pyarrow.Table.from_pylist(rows, schema)
    parquet.write_table(content, folder / f"{table.name}.parquet")
