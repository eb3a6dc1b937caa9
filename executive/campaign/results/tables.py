"""Conversion between the rows of a sweep and the tables of SQLite, derived from the fields of the rows."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, is_dataclass, replace
from typing import Any, Generic, TypeAlias, TypeVar, get_args, get_origin, get_type_hints

from pydantic import TypeAdapter

from executive.campaign.results.rows import ItemRow, Row, RunRow, SkillRow, SweepSettings

RowT = TypeVar("RowT", bound=Row)
SqlValue: TypeAlias = str | int | float | None
"""Value of a column; collections are stored as JSON."""


@dataclass(frozen=True)
class Column:
    """A column of a table.

    Attributes:
        path: Name of the field; for a nested dataclass, followed by the name of the inner field.
        sql_type: Type in SQLite.
        is_json: True if the column stores a mapping or a sequence as JSON text.
        comment: Description of the field. Of the columns of a nested dataclass, only the first one has a
            comment: the description of the outer field.
    """

    path: tuple[str, ...]
    sql_type: str
    is_json: bool
    comment: str

    @property
    def name(self) -> str:
        """Name of the column, for instance `audit_right`."""
        return "_".join(self.path)


class Table(Generic[RowT]):
    """A table with a column for each field of a class of rows, and for each field of a nested dataclass.

    Args:
        name: Name of the table.
        row_class: Class of the rows.
        key: Names of the columns of the primary key.

    Attributes:
        columns: The columns, in the order of the fields.
    """

    def __init__(self, name: str, row_class: type[RowT], *key: str) -> None:
        self.name, self.columns = name, tuple(_list_columns(row_class))
        self._key, self._comment = key, (row_class.__doc__ or "").strip()
        self._adapter = TypeAdapter(row_class)

    @property
    def creation_sql(self) -> str:
        """Statement that creates the table, with a comment for each column."""
        lines = [
            f"  {column.name} {column.sql_type},{column.comment and f' -- {column.comment}'}"
            for column in self.columns
        ]
        key = f"  PRIMARY KEY ({', '.join(self._key)})"
        return "\n".join((f"CREATE TABLE {self.name} ( -- {self._comment}", *lines, key, ")"))

    @property
    def insertion_sql(self) -> str:
        """Statement that inserts a row."""
        return f"INSERT INTO {self.name} VALUES ({', '.join('?' * len(self.columns))})"

    @property
    def selection_sql(self) -> str:
        """Statement that selects all rows, sorted by the first column of the key, then by insertion."""
        return f"SELECT * FROM {self.name} ORDER BY {self._key[0]}, rowid"

    def encode(self, row: RowT) -> tuple[SqlValue, ...]:
        """Return the values of the columns."""
        values = self._adapter.dump_python(row, mode="json")
        return tuple(_get_value(values, column) for column in self.columns)

    def decode(self, values: Sequence[SqlValue]) -> RowT:
        """Return the row with these values of the columns."""
        nested: dict[str, Any] = {}
        for column, value in zip(self.columns, values, strict=True):
            outer_name, *inner_names = column.path
            decoded = json.loads(str(value)) if column.is_json else value
            if inner_names and value is not None:
                nested.setdefault(outer_name, {})[inner_names[0]] = decoded
            else:
                nested[outer_name] = decoded
        return self._adapter.validate_python(nested)


def _list_columns(row_class: type) -> list[Column]:
    """Return the columns for the fields of a dataclass."""
    hints, columns = get_type_hints(row_class), []
    properties = TypeAdapter(row_class).json_schema()["properties"]
    for name, field_schema in properties.items():
        hint, comment = hints[name], field_schema.get("description", "")
        # A field with the type `T | None` has the columns of `T`.
        value_type = get_args(hint)[0] if type(None) in get_args(hint) else hint
        if isinstance(value_type, type) and is_dataclass(value_type):
            inner_columns = _list_columns(value_type)
            inner_columns[0] = replace(inner_columns[0], comment=comment)
            columns += [replace(column, path=(name, *column.path)) for column in inner_columns]
        else:
            # Generic types (`Mapping[K, V]`, `tuple[T, ...]`, `list[T]`) are collections, stored as JSON.
            sql_type = {bool: "INTEGER", int: "INTEGER", float: "REAL"}.get(value_type, "TEXT")
            columns.append(Column((name,), sql_type, get_origin(value_type) is not None, comment))
    return columns


def _get_value(values: Mapping[str, object], column: Column) -> SqlValue:
    """Return the value of a column from the nested values of a row."""
    value: object = values
    for name in column.path:
        value = value[name] if isinstance(value, Mapping) else None
    if column.is_json:
        return json.dumps(value, ensure_ascii=False)
    # SQLite has no Boolean type.
    return int(value) if isinstance(value, bool) else value  # type: ignore[return-value]


SETTINGS = Table("settings", SweepSettings, "mission")
RUNS = Table("runs", RunRow, "run_index")
ITEMS = Table("items", ItemRow, "run_index", "item")
SKILLS = Table("skills", SkillRow, "run_index", "skill")
