"""Grammar of mission files: keys, kinds of values and meanings, for parser, schema and documentation."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from executive.tree.keys import Key, KeyOwner


@dataclass(frozen=True)
class GrammarKey:
    """A key of a mapping.

    Attributes:
        kind: Kind of the value: `node`, `number`, `text`, `name`, `label`, `list`, `value` (any YAML value),
            or a list or mapping of such values: `names`, `values`, `variables`, `paths`, `params`, `routes`,
            `quotas`, `trees`, `args`.
        doc: Meaning of the key, one sentence.
        is_required: True if the key is mandatory.
    """

    kind: str
    doc: str
    is_required: bool = False


GrammarKeys = Mapping[str, GrammarKey]
"""The keys of a mapping by name."""

AllowedKeys = Mapping[str, Key | GrammarKey]
"""The keys of a mapping or of a control node by name."""

LABEL_PATTERN = "[a-z_][a-z0-9_]*"
"""Regular expression that every label matches."""

LABEL_KEY = GrammarKey("label", "Label of the node, for references in `on`, `until` and `catch`.")
"""The key `as`, an optional sibling of the keyword of a node."""

SEQUENCE_KEYWORD = "sequence"
"""Keyword that is assumed if a node is written as a plain list."""

USE_KEYWORD = "use"
"""Keyword of a node that uses a subtree."""

USE_SIBLINGS: GrammarKeys = {
    "with": GrammarKey("values", "Values of the subtree's arguments."),
    "returns": GrammarKey("variables", "Variable of the caller for each returned one: `pose: $grasp_pose`."),
}
"""Keys at the level of `use`."""

BEHAVIOUR_KEYWORD = "PyTree"
"""Keyword of a node that runs a behaviour of py_trees."""

BEHAVIOUR_CLASS = "class"
"""Key below `PyTree` for the import path of the behaviour; all other keys are its arguments and ports."""

BEHAVIOUR_KEYS: GrammarKeys = {
    BEHAVIOUR_CLASS: GrammarKey("text", "Import path of the behaviour: `module:Class`.", is_required=True),
}
"""The keys below `PyTree` that every behaviour has."""

KEYWORD_HINTS: Mapping[str, str] = {
    "then": "Write nodes that run in sequence as a list.",
    "do": 'Only control nodes have the key "do"; write the node without "do".',
    "with": 'Write "with" next to "use", with the same indentation.',
    "returns": 'Write "returns" next to "use", with the same indentation.',
}
"""Hints for words that authors write as keywords by mistake."""

MISSION_KEYS: GrammarKeys = {
    "mission": GrammarKey("name", "Name of the mission.", is_required=True),
    "description": GrammarKey("text", "Purpose of the mission, one sentence."),
    "cell": GrammarKey("text", "Cell file: a path relative to this or the shipped folder.", is_required=True),
    "library": GrammarKey("paths", "Library files: paths relative to this or the shipped folder."),
    "params": GrammarKey("params", "Constants, read as `$name`; `--set name=value` replaces a value."),
    "routes": GrammarKey("routes", "Bin, or list of permitted bins, for each class of objects."),
    "quotas": GrammarKey("quotas", "Maximum number of objects in a bin, in all or of each class."),
    "tree": GrammarKey("node", "Root node of the tree.", is_required=True),
    "trees": GrammarKey("trees", "Subtrees by name."),
}
"""The keys of a mission file."""

LIBRARY_KEYS: GrammarKeys = {
    "library": GrammarKey("name", "Name of the library.", is_required=True),
    "description": GrammarKey("text", "Content of the library, one sentence."),
    "trees": GrammarKey("trees", "Subtrees by name.", is_required=True),
}
"""The keys of a library file."""

SUBTREE_KEYS: GrammarKeys = {
    "doc": GrammarKey("text", "Purpose of the subtree, one sentence."),
    "args": GrammarKey("args", "Arguments of the subtree: a list of names, or names with defaults."),
    "returns": GrammarKey("names", "Variables that the caller gets; all other variables are then local."),
    "do": GrammarKey("node", "Root node of the subtree.", is_required=True),
}
"""The keys of a subtree."""

PARAM_KEYS: GrammarKeys = {
    "default": GrammarKey("value", "Default value; a param without a default must be set with `--set`."),
    "type": GrammarKey("name", "text, integer, number, boolean or list; by default the type of `default`."),
    "min": GrammarKey("number", "Minimum value."),
    "max": GrammarKey("number", "Maximum value."),
    "choices": GrammarKey("list", "Allowed values."),
    "doc": GrammarKey("text", "Meaning of the param, one sentence."),
}
"""The keys of a param whose declaration is a mapping."""


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
