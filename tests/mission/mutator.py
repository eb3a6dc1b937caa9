"""Changed and broken mission files by the thousand, each decided by its seed."""

from __future__ import annotations

import random
from collections.abc import Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import yaml

from executive.mission.source import Source
from executive.mission.text.yaml_text import parse_yaml
from tests.mission.mutations import Draft, mutate_text, roles

_TEXTUAL = 0.15
"""Share of the mutants that come from the text."""


@dataclass(frozen=True)
class Base:
    """A file to mutate.

    Attributes:
        name: What it is called.
        file: Where it stands below a mission's folder.
        text: What is in it.
        mission: The mission to load: the text itself, or that of a mission that names the file.
    """

    name: str
    file: str
    text: str
    mission: str


class Mutator:
    """Makes mutants of some files; a mutant is wholly decided by its seed."""

    def __init__(self, bases: Sequence[Base]) -> None:
        self._bases = bases
        self._data = [_data(base) for base in bases]
        self._pool: dict[str, list[Any]] = {}
        for data in self._data:
            for container, key, role in roles(data):
                self._pool.setdefault(role, []).append(container[key])

    def mutant(self, seed: int) -> tuple[Base, str]:
        """Return a base, and its text after one to three mutations."""
        rng = random.Random(seed)
        index, count = rng.randrange(len(self._bases)), rng.choice((1, 1, 1, 1, 1, 2, 2, 3))
        text = self._bases[index].text
        if rng.random() < _TEXTUAL:
            for _ in range(count):
                text = mutate_text(rng, text)
        else:
            draft = Draft(rng, deepcopy(self._data[index]), self._pool)
            for _ in range(count):
                draft.mutate()
            in_braces, width = rng.choice((None, None, False, True)), rng.choice((60, 200))
            text = yaml.safe_dump(draft.data, sort_keys=False, default_flow_style=in_braces, width=width)
        return self._bases[index], text


def _data(base: Base) -> Any:
    root, findings = parse_yaml(Source(base.file, base.text))
    assert root is not None, findings
    return root.python_value
