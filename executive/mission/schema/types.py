"""Python types and pydantic models as JSON Schema draft-07, which editors know best."""

from __future__ import annotations

from typing import Any

from pydantic import TypeAdapter
from pydantic.json_schema import GenerateJsonSchema

from executive.cell_config import CellConfig

Json = dict[str, Any]
"""A JSON Schema, or a part of one."""

ALTERNATIVE: Json = {"allOf": [True]}
"""Allows everything; without it yaml-language-server offers "- (array item)" beside every alternative."""

DIALECT = "http://json-schema.org/draft-07/schema#"


class Draft07(GenerateJsonSchema):
    """Pydantic's JSON Schema in the words of draft-07, without titles made up from names in the code."""

    def tuple_schema(self, schema: Any) -> Json:
        """Return the schema of a tuple, whose places draft-07 lists under `items`."""
        written = super().tuple_schema(schema)
        places = written.pop("prefixItems", None)
        if places is None:
            return written
        alike = all(place == places[0] for place in places)
        return {**written, "items": places[0] if alike else places}

    def model_schema(self, schema: Any) -> Json:
        """Return the schema of a section."""
        written = super().model_schema(schema)
        del written["title"]
        return written

    def field_title_should_be_set(self, schema: Any) -> bool:
        """Return False for every field."""
        del schema
        return False


def type_schema(declared: Any) -> Json:
    """Return the schema of the plain values of a Python type."""
    return TypeAdapter(declared).json_schema(schema_generator=Draft07)


def cell_schema() -> Json:
    """Return the schema of a cell file; one with a `base` needs no other key."""
    written = CellConfig.model_json_schema(schema_generator=Draft07, ref_template="#/definitions/{model}")
    sections, required = written.pop("$defs"), written.pop("required")
    return {
        "$schema": DIALECT,
        "title": "A cell",
        **written,
        "if": {"required": ["base"]},
        "else": {"required": required},
        "definitions": sections,
    }
