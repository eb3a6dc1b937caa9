"""The grammar of mission files: every key, what may stand under it, and what it means.

The parser, the checks, the JSON Schema and the documentation all read it here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Key:
    """A key of a mapping.

    Attributes:
        kind: Its content: `node`, `number`, `text`, `word`, `words`, `label`, `list`, `value`, `values`,
            `variables`, `paths`, `params`, `routes`, `trees`, `args`.
        doc: What it means, one sentence.
        required: True where it must be there.
    """

    kind: str
    doc: str
    required: bool = False


LABEL = "[a-z_][a-z0-9_]*"
"""How labels are written."""

AS = Key("label", "A name of its own, for `on`, `until` and `catch`.")
"""The key `as` beside the word of any node."""

SEQUENCE = "sequence"
"""Word of the control node that a bare list stands for."""

USE = "use"
"""Word before the name of a subtree."""

USE_PARTNERS: Mapping[str, Key] = {
    "with": Key("values", "Values of the subtree's arguments."),
    "returns": Key("variables", "Other names for the variables it returns: `its: $mine`."),
}
"""Keys that stand beside `use`."""

ELSEWHERE: Mapping[str, str] = {
    "then": "One after the other is a list.",
    "do": "Only control nodes have a do; elsewhere the node stands there itself.",
    "with": "It stands beside use, not below it.",
    "returns": "It stands beside use, not below it.",
}
"""Hints for words that are no nodes; control nodes have further ones."""

MISSION: Mapping[str, Key] = {
    "mission": Key("word", "Its name.", required=True),
    "description": Key("text", "What it does, one sentence."),
    "cell": Key("text", "The cell file, below this file's folder, or a shipped one.", required=True),
    "library": Key("paths", "Files with subtrees, below this file's folder, or shipped ones."),
    "params": Key("params", "Constants, written `$name`; `--set name=value` gives another value."),
    "routes": Key("routes", "For every class the bin it goes to, or a list of bins."),
    "tree": Key("node", "What is done.", required=True),
    "trees": Key("trees", "Subtrees by name."),
}
"""The keys of a mission file."""

LIBRARY: Mapping[str, Key] = {
    "library": Key("word", "Its name.", required=True),
    "description": Key("text", "What is in it, one sentence."),
    "trees": Key("trees", "Subtrees by name.", required=True),
}
"""The keys of a library file."""

SUBTREE: Mapping[str, Key] = {
    "doc": Key("text", "What it does, one sentence."),
    "args": Key("args", "Its arguments: a list of names, or names with defaults."),
    "returns": Key("words", "The variables it writes for others; with it, all others are its own."),
    "do": Key("node", "What is done.", required=True),
}
"""The keys of a subtree."""

PARAM: Mapping[str, Key] = {
    "default": Key("value", "Its value unless `--set` gives another; without it, it must be given."),
    "type": Key("word", "text, integer, number, boolean or list; without it, that of the default."),
    "min": Key("number", "Smallest value."),
    "max": Key("number", "Largest value."),
    "choices": Key("list", "The values it may have."),
    "doc": Key("text", "What it means, one sentence."),
}
"""The keys of a param that is declared by a mapping."""
