"""Keys of mission and library files, as pydantic models, for parser, schema and reference documentation.

The keys of a control node are fields of its class (`executive.tree.keys`).
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Annotated, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, WithJsonSchema
from pydantic.fields import FieldInfo

from executive.tree.keys import Key, KeyOwner
from executive.tree.specification import Child

NAME_EXPRESSION = "[A-Za-z_][A-Za-z0-9_]*"
"""Regular expression of the names of params, arguments, variables and subtrees."""
LABEL_EXPRESSION = "[a-z_][a-z0-9_]*"
"""Regular expression that every label matches."""
SEQUENCE_KEYWORD = "sequence"
"""Keyword that is assumed if a node is written as a plain list."""
USE_KEYWORD = "use"
"""Keyword of a node that uses a subtree."""
BEHAVIOUR_KEYWORD = "PyTree"
"""Keyword of a node that runs a behaviour of py_trees."""
BEHAVIOUR_CLASS = "class"
"""Key below `PyTree` for the import path of the behaviour; all other keys are its arguments and ports."""
KEYWORD_HINTS: Mapping[str, str] = {
    "then": "Write nodes that run in sequence as a list.",
    "do": 'Only control nodes have the key "do"; write the node without "do".',
    "with": 'Write "with" next to "use", with the same indentation.',
    "returns": 'Write "returns" next to "use", with the same indentation.',
}
"""Hints for words that authors write as keywords by mistake."""

Text: TypeAlias = str | float | bool
"""A text; a number or a boolean is a text, too."""
Name: TypeAlias = Annotated[str, Field(pattern=f"^{NAME_EXPRESSION}$")]
"""Name of a param, an argument, a variable or a subtree."""
TitleName: TypeAlias = Annotated[str, Field(pattern="^[A-Za-z_][A-Za-z0-9_-]*$")]
"""Name of a mission or a library."""
DollarName: TypeAlias = Annotated[str, Field(pattern=rf"^\$?{NAME_EXPRESSION}$")]
"""Name of a variable, with or without `$`."""
ReferenceText: TypeAlias = Annotated[str, WithJsonSchema({"definition": "reference"})]
"""`$name` or `$name.field`."""
Files: TypeAlias = str | Annotated[list[str], Field(min_length=1)]
"""Path of a file, or a list of paths."""
Limit: TypeAlias = Annotated[int, Field(ge=1)] | ReferenceText
"""Maximum number of objects."""


class FileKeys(BaseModel):
    """Base class of the keys of a mapping in a mission or library file; each field declares a key."""

    model_config = ConfigDict(extra="forbid", defer_build=True, arbitrary_types_allowed=True)

    @classmethod
    @cache
    def get_keys(cls) -> Mapping[str, FieldInfo]:
        """Return the fields by the names of the keys in the file."""
        return {field.alias or name: field for name, field in cls.model_fields.items()}


class NodeKeys(FileKeys):
    """Key at the level of the keyword of every node."""

    label: Annotated[str, Field(pattern=f"^{LABEL_EXPRESSION}$")] = Field(
        "", alias="as", description="Label of the node, for references in `on`, `until` and `catch`."
    )


class UseKeys(FileKeys):
    """Keys at the level of `use`."""

    arguments: dict[Name, object] | None = Field(
        None, alias="with", description="Values of the subtree's arguments."
    )
    returns: dict[Name, ReferenceText] | None = Field(
        None, description="Variable of the caller for each returned one: `pose: $grasp_pose`."
    )


class BehaviourKeys(FileKeys):
    """The key below `PyTree` that every behaviour has; all other keys are its arguments and ports."""

    model_config = ConfigDict(extra="allow")

    behaviour: Text = Field(
        alias=BEHAVIOUR_CLASS, description="Import path of the behaviour: `module:Class`."
    )


class ParamKeys(FileKeys):
    """Keys of a param; a value without keys is the default."""

    model_config = ConfigDict(
        json_schema_extra={"type": ["object", "array", "string", "number", "boolean", "null"]}
    )

    default: object = Field(
        None, description="Default value; a param without a default must be set with `--set`."
    )
    type: Literal["text", "integer", "number", "boolean", "list"] = Field(
        "text", description="text, integer, number, boolean or list; by default the type of `default`."
    )
    min: float = Field(0.0, description="Minimum value.")
    max: float = Field(0.0, description="Maximum value.")
    choices: list[object] | ReferenceText = Field([], description="Allowed values.")
    doc: Text = Field("", description="Meaning of the param, one sentence.")


class SubtreeKeys(FileKeys):
    """Keys of a subtree; a node without these keys is a subtree without arguments."""

    doc: Text = Field("", description="Purpose of the subtree, one sentence.")
    args: dict[Name, object] | list[TitleName] | None = Field(
        None, description="Arguments of the subtree: a list of names, or names with defaults."
    )
    returns: DollarName | list[DollarName] = Field(
        [], description="Variables that the caller gets; all other variables are then local."
    )
    do: Child = Field(description="Root node of the subtree.")


class LibraryKeys(FileKeys):
    """Keys of a library file."""

    library: TitleName = Field(description="Name of the library.")
    description: Text = Field("", description="Content of the library, one sentence.")
    trees: dict[Name, Child | SubtreeKeys] | None = Field(description="Subtrees by name.")


class MissionKeys(FileKeys):
    """Keys of a mission file."""

    mission: TitleName = Field(description="Name of the mission.")
    description: Text = Field("", description="Purpose of the mission, one sentence.")
    cell: Text = Field(description="Cell file: a path relative to this or the shipped folder.")
    library: Files = Field([], description="Library files: paths relative to this or the shipped folder.")
    params: dict[Name, ParamKeys] | None = Field(
        None, description="Constants, read as `$name`; `--set name=value` replaces a value."
    )
    routes: dict[str, Files] | None = Field(
        None, description="Bin, or list of permitted bins, for each class of objects."
    )
    quotas: dict[str, Limit | Annotated[dict[str, Limit], Field(min_length=1)]] | None = Field(
        None, description="Maximum number of objects in a bin, in all or of each class."
    )
    tree: Child = Field(description="Root node of the tree.")
    trees: dict[Name, Child | SubtreeKeys] | None = Field(None, description="Subtrees by name.")


def find_shorthand_key(owner: type[KeyOwner]) -> Key | None:
    """Return the key whose value may directly follow the keyword of a node or section, or None."""
    return next((key for key in owner.keys.values() if key.shorthand), None)


def is_value_optional(node_class: type[KeyOwner]) -> bool:
    """Return True if the keyword of a node may stand alone, without a value."""
    shorthand_key = find_shorthand_key(node_class)
    return shorthand_key is not None and not shorthand_key.is_required


def find_inner_keys(owner: type[KeyOwner]) -> Mapping[str, Key]:
    """Return the keys of the mapping below a keyword; no keys if the value must not be a mapping."""
    inner_keys = {name: key for name, key in owner.keys.items() if not key.sibling}
    return {} if all(key.shorthand for key in inner_keys.values()) else inner_keys


def find_sibling_keys(owner: type[KeyOwner]) -> Mapping[str, Key]:
    """Return the keys at the level of the keyword."""
    return {name: key for name, key in owner.keys.items() if key.sibling}
