"""Changed and broken mission files by the thousand, each decided by its seed."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass
from typing import Any

import yaml
from draft import Draft
from mutations_of_data import OF_DATA
from mutations_of_text import OF_TEXT

from executive.mission.source import Source
from executive.mission.text.yaml_text import parse_yaml, plain
from executive.skill import Skill

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


@dataclass(frozen=True)
class Mutant:
    """A mutated file: what it was, what was done to it, and its text now."""

    base: Base
    mutations: tuple[str, ...]
    text: str


class Mutator:
    """Makes mutants of some files; a mutant is wholly decided by its seed.

    Args:
        bases: The files.
        skills: Installed skills by name, to insert and to wire.
    """

    def __init__(self, bases: Sequence[Base], skills: Mapping[str, type[Skill]]) -> None:
        self._bases, self._skills = bases, skills
        self._data = [_data(base) for base in bases]

    def mutant(self, seed: int) -> Mutant:
        """Return the mutant of a seed: one to four mutations of one file."""
        rng = random.Random(seed)
        index, count = rng.randrange(len(self._bases)), rng.choice((1, 1, 1, 1, 2, 2, 3, 4))
        changed = self._of_text if rng.random() < _TEXTUAL else self._of_data
        return changed(rng, index, count)

    def _of_text(self, rng: random.Random, index: int, count: int) -> Mutant:
        text, changes = self._bases[index].text, rng.choices(OF_TEXT, k=count)
        for change in changes:
            text = change(rng, text)
        return Mutant(self._bases[index], tuple(change.__name__ for change in changes), text)

    def _of_data(self, rng: random.Random, index: int, count: int) -> Mutant:
        draft, done = Draft(rng, deepcopy(self._data[index]), self._skills), []
        while len(done) < count:
            change = rng.choices(list(OF_DATA), list(OF_DATA.values()))[0]
            if change(draft):
                done.append(change.__name__)
        in_braces, width = rng.choice((None, None, False, True)), rng.choice((60, 200))
        text = yaml.safe_dump(draft.data, sort_keys=False, default_flow_style=in_braces, width=width)
        return Mutant(self._bases[index], tuple(done), text)


def _data(base: Base) -> Any:
    root, findings = parse_yaml(Source(base.file, base.text))
    assert root is not None, findings
    return plain(root)
