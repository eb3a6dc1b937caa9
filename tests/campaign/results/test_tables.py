"""Columns of the tables, by the types of the fields."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from executive.campaign.results.rows import Row
from executive.campaign.results.tables import Table


@dataclass(frozen=True)
class Sample(Row):
    """A row with optional values and collections."""

    number: float | None
    """A number, or NULL."""
    count: int | None
    """A count, or NULL."""
    is_valid: bool | None
    """A Boolean value, or NULL."""
    name: str | None
    """A name, or NULL."""
    sizes: tuple[int, ...]
    """Sizes."""
    names: list[str]
    """Names."""
    values: Mapping[str, str] | None
    """Values by name, or NULL."""


TABLE = Table("samples", Sample, "number")


def test_an_optional_column_has_the_type_of_its_values() -> None:
    types = {column.name: (column.sql_type, column.is_json) for column in TABLE.columns}
    assert types == {
        "number": ("REAL", False),
        "count": ("INTEGER", False),
        "is_valid": ("INTEGER", False),
        "name": ("TEXT", False),
        "sizes": ("TEXT", True),
        "names": ("TEXT", True),
        "values": ("TEXT", True),
    }


def test_optional_values_and_collections_are_read_as_they_were_stored() -> None:
    full = Sample(0.5, 3, True, "a", (1, 2), ["x"], {"k": "v"})
    assert TABLE.encode(full) == (0.5, 3, 1, "a", "[1, 2]", '["x"]', '{"k": "v"}')
    for sample in (full, Sample(None, None, None, None, (), [], None)):
        assert TABLE.decode(TABLE.encode(sample)) == sample
