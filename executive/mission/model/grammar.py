"""The grammar of mission files: every key, what may stand under it, and what it means.

The parser, the checks, the JSON Schema and the documentation all read it here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class GrammarKey:
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

AS = GrammarKey("label", "A name of its own, for `on`, `until` and `catch`.")
"""The key `as` beside the keyword of any node."""

SEQUENCE = "sequence"
"""Keyword of the control node that a bare list stands for."""

USE = "use"
"""Word before the name of a subtree."""

USE_SIBLINGS: Mapping[str, GrammarKey] = {
    "with": GrammarKey("values", "Values of the subtree's arguments."),
    "returns": GrammarKey("variables", "Other names for the variables it returns: `its: $mine`."),
}
"""Keys that stand beside `use`."""

FOREIGN_KEYWORDS: Mapping[str, str] = {
    "then": "One after the other is a list.",
    "do": "Only control nodes have a do; elsewhere the node stands there itself.",
    "with": "It stands beside use, not below it.",
    "returns": "It stands beside use, not below it.",
}
"""Hints for words that are no nodes; control nodes have further ones."""

MISSION: Mapping[str, GrammarKey] = {
    "mission": GrammarKey("word", "Its name.", required=True),
    "description": GrammarKey("text", "What it does, one sentence."),
    "cell": GrammarKey("text", "The cell file, below this file's folder, or a shipped one.", required=True),
    "library": GrammarKey("paths", "Files with subtrees, below this file's folder, or shipped ones."),
    "params": GrammarKey("params", "Constants, written `$name`; `--set name=value` gives another value."),
    "routes": GrammarKey("routes", "For every class the bin it goes to, or a list of bins."),
    "tree": GrammarKey("node", "What is done.", required=True),
    "trees": GrammarKey("trees", "Subtrees by name."),
}
"""The keys of a mission file."""

LIBRARY: Mapping[str, GrammarKey] = {
    "library": GrammarKey("word", "Its name.", required=True),
    "description": GrammarKey("text", "What is in it, one sentence."),
    "trees": GrammarKey("trees", "Subtrees by name.", required=True),
}
"""The keys of a library file."""

SUBTREE: Mapping[str, GrammarKey] = {
    "doc": GrammarKey("text", "What it does, one sentence."),
    "args": GrammarKey("args", "Its arguments: a list of names, or names with defaults."),
    "returns": GrammarKey("words", "The variables it writes for others; with it, all others are its own."),
    "do": GrammarKey("node", "What is done.", required=True),
}
"""The keys of a subtree."""

PARAM: Mapping[str, GrammarKey] = {
    "default": GrammarKey("value", "Its value unless `--set` gives another; without it, it must be given."),
    "type": GrammarKey("word", "text, integer, number, boolean or list; without it, that of the default."),
    "min": GrammarKey("number", "Smallest value."),
    "max": GrammarKey("number", "Largest value."),
    "choices": GrammarKey("list", "The values it may have."),
    "doc": GrammarKey("text", "What it means, one sentence."),
}
"""The keys of a param that is declared by a mapping."""
