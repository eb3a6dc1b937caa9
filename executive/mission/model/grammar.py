"""The grammar of mission files: every key, what may stand under it, and what it means.

The parser, the checks, the JSON Schema and the documentation all read it here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True)
class Key:
    """A key of a mapping.

    Attributes:
        kind: What stands under it: `node`, `nodes`, `catches`, `reasons`, `integer`, `number`, `boolean`,
            `text`, `word`, `words`, `label`, `list`, `value`, `values`, `variables`, `backoff`, `count`,
            `paths`, `params`, `routes`, `trees`, `args`.
        doc: What it means, one sentence.
        required: True where it must be there.
        minimum: Smallest number, or None.
        above: Number that it must be greater than, or None.
    """

    kind: str
    doc: str
    required: bool = False
    minimum: float | None = None
    above: float | None = None

    def allows(self, number: float) -> bool:
        """Tell whether a number is within the bounds."""
        enough = self.minimum is None or number >= self.minimum
        return enough and (self.above is None or number > self.above)

    @property
    def bounds(self) -> str:
        """The bounds in words, to follow `must be`."""
        return f"more than {self.above:g}" if self.above is not None else f"at least {self.minimum or 0:g}"


@dataclass(frozen=True)
class Form:
    """How a control node is written.

    Attributes:
        doc: What it does.
        keys: The keys of the mapping under its word; empty where no mapping stands there.
        short: What may stand under its word instead of the mapping (a kind as in `Key`), or "".
        partners: Keys that stand beside its word.
        one_of: Keys or partners of which one at least must be there.
    """

    doc: str
    keys: Mapping[str, Key] = field(default_factory=dict)
    short: str = ""
    partners: Mapping[str, Key] = field(default_factory=dict)
    one_of: tuple[str, ...] = ()


LABEL = "[a-z_][a-z0-9_]*"
"""How labels are written."""

AS = Key("label", "A name of its own, for `on`, `until` and `catch`.")
"""The key `as` beside the word of any node."""

_DO = Key("node", "What is done.", required=True)

CATCH: Mapping[str, Key] = {
    "on": Key("reasons", "The failures this is for.", required=True),
    "do": Key("node", "What is done instead.", required=True),
}

BACKOFF: Mapping[str, Key] = {
    "first": Key("number", "Wait before the second attempt [s].", required=True, above=0),
    "factor": Key("number", "By how much every further wait is longer; 1 if not given.", minimum=1),
    "most": Key("number", "Longest wait [s].", above=0),
}

CONTROL: Mapping[str, Form] = {
    "sequence": Form("One after the other; fails with the first that fails.", short="nodes"),
    "fallback": Form(
        "One after the other until one succeeds; fails with the failure of the last.", short="nodes"
    ),
    "parallel": Form(
        "All at the same time. Running ones may finish before it fails.",
        {
            "wait_for": Key(
                "count",
                "How many must succeed: `all`, `any` or a number; `lead`: the first branch alone.",
                minimum=1,
            ),
            "halt": Key("boolean", "After a failure halt the others at once instead of letting them finish."),
            "do": Key("nodes", "What is done at the same time.", required=True),
        },
        short="nodes",
    ),
    "retry": Form(
        "Again after a failure.",
        {
            "attempts": Key("integer", "How often at most, first time included.", required=True, minimum=1),
            "on": Key("reasons", "Failures worth another attempt; every failure if not given."),
            "recover": Key("node", "What is done before every further attempt."),
            "backoff": Key(
                "backoff", "Wait before every further attempt [s], or first, factor and most.", above=0
            ),
            "do": _DO,
        },
    ),
    "repeat": Form(
        "Again after a success, so many times or until it fails in a certain way.",
        {
            "times": Key("integer", "How often at most.", minimum=0),
            "until": Key("reasons", "Failures that end it with success."),
            "do": _DO,
        },
        one_of=("times", "until"),
    ),
    "while": Form(
        "Again as long as a condition succeeds, which is asked before every round.",
        {
            "condition": Key("node", "What is asked; its failure ends the loop with success.", required=True),
            "do": _DO,
        },
    ),
    "for_each": Form(
        "Once for every element of a list, in order.",
        {
            "each": Key("word", "The variable that holds the element.", required=True),
            "in": Key("list", "A list, or a variable that holds one.", required=True),
            "do": _DO,
        },
    ),
    "try": Form(
        "A body, what to do instead when it fails, and what to do in the end either way.",
        short="node",
        partners={
            "catch": Key("catches", "A list of `on` and `do`: what to do instead after a failure."),
            "finally": Key("node", "What is done in the end, after success or failure."),
        },
        one_of=("catch", "finally"),
    ),
    "timeout": Form(
        "Fails with `timeout` when its body takes longer on the run's clock.",
        {"seconds": Key("number", "How long it may take [s].", required=True, above=0), "do": _DO},
    ),
    "invert": Form("Succeeds where its body fails; fails with `inverted` where it succeeds.", short="node"),
    "succeed": Form("Succeeds however its body ends; without a body at once.", short="node?"),
    "use": Form(
        "A subtree by its name.",
        short="word",
        partners={
            "with": Key("values", "Values of the subtree's arguments."),
            "returns": Key("variables", "Other names for the variables it returns: `its: $mine`."),
        },
    ),
}
"""Every control node by its word."""

ELSEWHERE: Mapping[str, str] = {
    "if": "To go another way when something fails, write try and catch, or a fallback.",
    "else": "To go another way when something fails, write try and catch, or a fallback.",
    "selector": "It is called fallback here.",
    "for": "It is called for_each here.",
    "loop": "It is called repeat here, or while with a condition.",
    "then": "One after the other is a list.",
    "do": "Only control nodes have a do; elsewhere the node stands there itself.",
    "catch": "It stands beside try, not below it.",
    "finally": "It stands beside try, not below it.",
    "with": "It stands beside use, not below it.",
    "returns": "It stands beside use, not below it.",
}
"""What to write instead of words that other languages have."""

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
