"""No file but its own names a control node."""

from __future__ import annotations

import inspect
from pathlib import Path

import executive
from executive.mission.grammar import CONDITION_KEYWORD, SEQUENCE_KEYWORD, SET_KEYWORD, USE_KEYWORD
from executive.tree.node import load_control_nodes

PERMITTED = {
    ("mission/grammar.py", f'"{SEQUENCE_KEYWORD}"'),
    ("mission/grammar.py", f'"{USE_KEYWORD}"'),
    ("mission/grammar.py", f'"{SET_KEYWORD}"'),
    ("mission/grammar.py", f'"{CONDITION_KEYWORD}"'),
    *(
        (file, '"not"')
        for file in (
            "tree/expression.py",
            "tree/specification.py",
            "view/btcpp.py",
            "mission/check_expressions.py",
        )
    ),
    ("cell/arm_config.py", '"if"'),  # word of JSON Schema
    ("mission/schema.py", '"if"'),
    ("drivers/sim/scene.py", '"any"'),  # any class of objects
    ("skill.py", '"any"'),  # any state of the tool
    ("record/result.py", '"repeat"'),  # label before the command that repeats a run
    # The table of former and foreign words states what to write instead.
    *(
        ("text/findings.py", f'"{word}"')
        for word in ("all", "any", "fallback", "for_each", "if", "repeat", "try")
    ),
}
"""The words that belong to the grammar, and words that mean something else."""


def test_no_other_file_names_a_control_node() -> None:
    package = Path(inspect.getfile(executive)).parent
    kinds = load_control_nodes().values()
    words = {f'"{word}"' for word in (USE_KEYWORD, *(kind.keyword for kind in kinds))}
    words |= {f"from {kind.__module__} import" for kind in kinds}
    own = {Path(inspect.getfile(kind)) for kind in kinds}
    found = {
        (file.relative_to(package).as_posix(), word)
        for file in sorted(package.rglob("*.py"))
        if file not in own
        for word in words
        if word in file.read_text(encoding="utf-8")
    }
    assert found == PERMITTED
