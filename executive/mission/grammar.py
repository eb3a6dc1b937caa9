"""Mappings of mission and library files: their keys, as pydantic models, and the reader of their values.

The keys of a control node are fields of its class (`executive.tree.keys`).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Annotated, Literal, TypeAlias

from pydantic import BaseModel, ConfigDict, Field, JsonValue, WithJsonSchema
from pydantic.fields import FieldInfo

from executive.text.findings import Finding, Span, make_error, suggest_choice
from executive.text.yaml_files import YamlMapping, YamlNode, YamlScalar, YamlSequence, list_scalars
from executive.tree.expression import MARK, read_expression
from executive.tree.specification import (
    Child,
    Constant,
    Expression,
    InvalidValue,
    LocatedName,
    Reason,
    Reference,
    Value,
)

NAME_EXPRESSION = "[A-Za-z_][A-Za-z0-9_]*"
"""Regular expression of the names of params, arguments, variables and subtrees."""
LABEL_EXPRESSION = "[a-z_][a-z0-9_]*"
"""Regular expression that every label matches."""
SEQUENCE_KEYWORD = "sequence"
"""Keyword that is assumed if a node is written as a plain list."""
SET_KEYWORD = "set"
"""Keyword of a node that gives a variable a new value."""
CONDITION_KEYWORD = "holds"
"""Keyword that is assumed if a condition is written as an expression."""
USE_KEYWORD = "use"
"""Keyword of a node that uses a subtree."""
BEHAVIOUR_KEYWORD = "PyTree"
"""Keyword of a node that runs a behaviour of py_trees."""
BEHAVIOUR_CLASS = "class"
"""Key below `PyTree` for the import path of the behaviour; all other keys are its arguments and ports."""
KEYWORD_HINTS: Mapping[str, str] = {
    "then": "Write nodes that run in sequence as a list; `then` is a key below `if`.",
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
    """Base class of the keys of a mapping in a mission or library file; each field declares a key.

    The docstrings of the fields are the descriptions in the schema.
    """

    model_config = ConfigDict(extra="forbid", defer_build=True, arbitrary_types_allowed=True)

    @classmethod
    @cache
    def get_keys(cls) -> Mapping[str, FieldInfo]:
        """Return the fields by the names of the keys in the file."""
        return {field.alias or name: field for name, field in cls.model_fields.items()}


class NodeKeys(FileKeys):
    """Key at the level of the keyword of every node."""

    label: Annotated[str, Field(pattern=f"^{LABEL_EXPRESSION}$")] = Field("", alias="as")
    """Label of the node, for references in `on`, `until` and `catch`."""


class UseKeys(FileKeys):
    """Keys at the level of `use`."""

    arguments: dict[Name, object] | None = Field(None, alias="with")
    """Values of the subtree's arguments."""
    returns: dict[Name, ReferenceText] | None = None
    """Variable of the caller for each returned one: `pose: $grasp_pose`."""


class BehaviourKeys(FileKeys):
    """The key below `PyTree` that every behaviour has; all other keys are its arguments and ports."""

    model_config = ConfigDict(extra="allow")

    behaviour: Text = Field(alias=BEHAVIOUR_CLASS)
    """Import path of the behaviour: `module:Class`."""


class ParamKeys(FileKeys):
    """Keys of a param; a value without keys is the default."""

    model_config = ConfigDict(
        json_schema_extra={"type": ["object", "array", "string", "number", "boolean", "null"]}
    )

    default: object = None
    """Default value; a param without a default must be set with `--set`."""
    type: Literal["text", "integer", "number", "boolean", "list"] = "text"
    """text, integer, number, boolean or list; by default the type of `default`."""
    min: float = 0.0
    """Minimum value."""
    max: float = 0.0
    """Maximum value."""
    choices: list[object] | ReferenceText = []
    """Allowed values."""
    doc: Text = ""
    """Meaning of the param, one sentence."""


class VariableKeys(ParamKeys):
    """Keys of a variable that `set` changes; a value without keys is the initial value."""

    default: object = None
    """Initial value."""
    unit: Literal["s", "m", "m/s", "N"] = "s"
    """Unit of a number: s, m, m/s or N."""


class SubtreeKeys(FileKeys):
    """Keys of a subtree; a node without these keys is a subtree without arguments."""

    doc: Text = ""
    """Purpose of the subtree, one sentence."""
    args: dict[Name, object] | list[TitleName] | None = None
    """Arguments of the subtree: a list of names, or names with defaults."""
    returns: DollarName | list[DollarName] = []
    """Variables that the caller gets; all other variables are then local."""
    variables: dict[Name, VariableKeys] | None = None
    """Local variables with their initial values, which `set` changes."""
    do: Child
    """Root node of the subtree."""


class LibraryKeys(FileKeys):
    """Keys of a library file."""

    library: TitleName
    """Name of the library."""
    description: Text = ""
    """Content of the library, one sentence."""
    trees: dict[Name, Child | SubtreeKeys] | None
    """Subtrees by name."""


class MissionKeys(FileKeys):
    """Keys of a mission file."""

    mission: TitleName
    """Name of the mission."""
    description: Text = ""
    """Purpose of the mission, one sentence."""
    cell: Text
    """Cell file: a path relative to this or the shipped folder."""
    library: Files = []
    """Library files: paths relative to this or the shipped folder."""
    params: dict[Name, ParamKeys] | None = None
    """Constants, read as `$name`; `--set name=value` replaces a value."""
    variables: dict[Name, VariableKeys] | None = None
    """Variables with their initial values, read as `$name`; `set` changes a value."""
    routes: dict[str, Files] | None = None
    """Bin, or list of permitted bins, for each class of objects."""
    quotas: dict[str, Limit | Annotated[dict[str, Limit], Field(min_length=1)]] | None = None
    """Maximum number of objects in a bin, in all or of each class."""
    tree: Child
    """Root node of the tree."""
    trees: dict[Name, Child | SubtreeKeys] | None = None
    """Subtrees by name."""


NAME_PATTERN = re.compile(NAME_EXPRESSION)
"""Matches the names of params, arguments, variables and subtrees."""
REFERENCE_PATTERN = re.compile(rf"\$({NAME_PATTERN.pattern})(?:\.({NAME_PATTERN.pattern}))?")
"""Matches `$name` and `$name.field`."""
_REFERENCE_START = re.compile(r"^\$|\$(?=[A-Za-z_])")
"""Matches `$` at the start of a text, or before a letter."""
_FAILURE_PATTERN = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)\.([A-Za-z_][A-Za-z0-9_]*)")
"""Matches `Skill.reason` and `label.reason`."""


class MappingReader:
    """Reader of one mapping; reports unknown keys and missing keys at construction.

    Attributes:
        owner: Name, in messages, of the node, key or file to which the mapping belongs.
        span: Position of the owner, for findings about missing keys.
        findings: List to which the reader adds its findings.
    """

    def __init__(
        self, owner: str, span: Span, node: YamlNode, keys: Mapping[str, FieldInfo], findings: list[Finding]
    ) -> None:
        self.owner = owner
        self.span = span
        self.findings = findings
        self._mapping = node if isinstance(node, YamlMapping) else YamlMapping(node.span, {})
        if not isinstance(node, YamlMapping):
            message = f"{owner} must be a mapping, not {node.description}"
            self.add_error(node.span, "wrong-type", message, f"Its keys: {', '.join(keys)}.")
            return
        for name, entry in self._mapping.entries.items():
            if name not in keys:
                hint = suggest_choice(name, keys, "Allowed keys")
                self.add_error(entry.key.span, "unknown-key", f'{owner} has no key "{name}"', hint)
        for name, key in keys.items():
            if key.is_required() and self.get(name) is None:
                self.add_error(span, "missing-key", f'{owner} needs the key "{name}"')

    def get(self, key: str) -> YamlNode | None:
        """Return the value of `key`, or None."""
        return self._mapping.get(key)

    def get_key_span(self, key: str) -> Span:
        """Return the position of `key`, or of the owner if the key is missing."""
        entry = self._mapping.entries.get(key)
        return entry.key.span if entry else self.span

    def get_value_span(self, key: str) -> Span:
        """Return the position of the value of `key`, or of the owner if the key is missing."""
        return (self.get(key) or self).span

    def read_text(self, key: str) -> str:
        """Return the text below `key`, or ""; add an error for a list, a mapping or null."""
        node = self.get(key)
        if node is None:
            return ""
        if isinstance(node, YamlScalar) and node.value is not None:
            return node.text
        message = f"{self._describe_key(key)} must be a text, not {node.description}"
        self.add_error(node.span, "wrong-type", message)
        return ""

    def read_reasons(self, key: str, *, accepts_expressions: bool) -> tuple[Reason | Expression, ...]:
        """Return the failure names in the list or single value of `key`; add an error for invalid items.

        If the value may also contain expressions, these begin with `=`.
        """
        node = self.get(key)
        names: list[Reason | Expression] = []
        if isinstance(node, YamlSequence) and not node.items:
            hint = f'To match every failure, delete "{key}".'
            self.add_error(node.span, "empty-list", f"{self._describe_key(key)} names no failure", hint)
        for item in self.list_items(key):
            text = item.text if isinstance(item, YamlScalar) else ""
            if accepts_expressions and text.startswith(MARK):
                expression = read_expression(text, item.span, self.findings)
                names += [expression] if isinstance(expression, Expression) else []
            elif match := _FAILURE_PATTERN.fullmatch(text):
                names.append(Reason(match[1], match[2], span=item.span))
            else:
                rule = f"{self._describe_key(key)} must name failures as Skill.reason or label.reason"
                if accepts_expressions:
                    rule += ", or be an expression such as = run.placed >= 4"
                message = f'{rule}, not "{text}"' if text else f"{rule}, not {item.description}"
                self.add_error(item.span, "bad-match", message)
        return tuple(names)

    def list_items(self, key: str) -> tuple[YamlNode, ...]:
        """Return the items of the list under `key`; a single value counts as a list with one item."""
        node = self.get(key)
        if isinstance(node, YamlSequence):
            return node.items
        return () if node is None else (node,)

    def iterate_entries(self, key: str) -> Iterator[tuple[LocatedName, YamlNode]]:
        """Yield name and value of each entry below `key`."""
        node = self.get(key)
        if isinstance(node, YamlMapping):
            for name, entry in node.entries.items():
                yield LocatedName(name, entry.key.span), entry.value
        elif node is not None and not is_empty(node):
            message = f"{self._describe_key(key)} must be a mapping, not {node.description}"
            self.add_error(node.span, "wrong-type", message)

    def check_name(self, name: LocatedName, kind: str, hint: str = "") -> None:
        """Add an error if `name` is not a valid name; `kind` is the kind of name, such as `a param`."""
        if not NAME_PATTERN.fullmatch(name):
            hint = hint or 'Use letters, digits and "_", and begin with no digit.'
            self.add_error(name.span, "bad-name", f'"{name}" is no valid name of {kind}', hint)

    def add_error(self, span: Span, code: str, message: str, hint: str = "") -> None:
        """Add an error to the findings."""
        self.findings.append(make_error(span, code, message, hint))

    def _describe_key(self, key: str) -> str:
        """Return the name of a key in messages: `retry.on`, or `params of the mission`."""
        return f"{key} of {self.owner}" if " " in self.owner else f"{self.owner}.{key}"


def is_empty(node: YamlNode) -> bool:
    """Return True for a key without value, or with the value null."""
    return isinstance(node, YamlScalar) and node.value is None


def read_settings(
    node: YamlNode | None,
    owner: str,
    findings: list[Finding],
    example_key: str = "name",
    expression_keys: Sequence[str] = (),
) -> dict[LocatedName, Value]:
    """Return the settings below `owner`, a skill or a key; the hint of an error shows `example_key`.

    The values of `expression_keys` are expressions, also without `=`.
    """
    if node is None or is_empty(node):
        return {}
    if not isinstance(node, YamlMapping):
        message = f"the value of {owner} must be a mapping of names to values, not {node.description}"
        hint = f"Write {owner}: {{{example_key}: {node.text}}}." if isinstance(node, YamlScalar) else ""
        findings.append(make_error(node.span, "wrong-type", message, hint))
        return {}
    return {
        LocatedName(key, entry.key.span): read_expression(entry.value.text, entry.value.span, findings)
        if key in expression_keys and isinstance(entry.value, YamlScalar)
        else read_value(entry.value, findings)
        for key, entry in node.entries.items()
    }


def read_value(node: YamlNode, findings: list[Finding]) -> Value:
    """Return a reference for `$name` or `$name.field`, an expression after `=`, or else a constant.

    In a constant, `$` replaces each `$$`.
    """
    text = node.value if isinstance(node, YamlScalar) else None
    if isinstance(text, str) and text.startswith(MARK):
        return read_expression(text, node.span, findings)
    if isinstance(text, str) and (match := REFERENCE_PATTERN.fullmatch(text)):
        return Reference(match[1], node.span, match[2] or "")
    errors = list(_find_misplaced_dollars(node))
    findings += errors
    literal = make_literal(node)
    return InvalidValue(node.span) if errors else replace(literal, value=_unescape(literal.value))


def make_literal(node: YamlNode) -> Constant:
    """Return a node as a constant with its position and the positions of its elements."""
    element_spans = tuple(item.span for item in node.items) if isinstance(node, YamlSequence) else ()
    return Constant(node.python_value, node.span, element_spans=element_spans)


def _find_misplaced_dollars(node: YamlNode) -> Iterator[Finding]:
    """Yield an error for each text with a `$`, not escaped as `$$`, at the start or before a letter."""
    for scalar in list_scalars(node):
        if isinstance(scalar.value, str) and _REFERENCE_START.search(scalar.value.replace("$$", "")):
            rule = "a reference is a whole value, as in key: $name or key: $name.field"
            message = f'"{scalar.text}" is no reference: {rule}'
            hint = f'For the character $, write $$: "{scalar.text.replace("$", "$$")}".'
            yield make_error(scalar.span, "bad-reference", message, hint)


def _unescape(value: JsonValue) -> JsonValue:
    """Return a plain value in which `$` replaces each `$$`."""
    if isinstance(value, str):
        return value.replace("$$", "$")
    if isinstance(value, list):
        return [_unescape(item) for item in value]
    return {key: _unescape(item) for key, item in value.items()} if isinstance(value, dict) else value
