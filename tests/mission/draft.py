"""A mission file's data while it is being mutated: where its nodes stand, and random parts that suit it."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from typing import Any

from executive.mission.model.typed import is_plain
from executive.skill import Direction, Param, Port, Skill

Place = tuple[Any, Any]
"""A list or mapping, and the index or key in it of what stands there."""

ODD_VALUES: tuple[Any, ...] = (
    None, True, False, 0, 1, 2, -1, 3, 0.5, 1e-9, 1e300, -1e300, 10**40, float("nan"), float("inf"), "",
    " ", "$", "$$", "$x", "$$x", "$a.b", "text", "auto", "Detect", "Grasp.missed", "a: b", "\n", "\u2028x",
    "\ud800", "x" * 300,
    [], [[]], [None], [1, "a", None], {}, {"do": None}, {"a": {"b": [{}]}}, ["succeed"], "succeed",
)  # fmt: skip

_BODIES = (
    "do", "recover", "condition", "finally", "sequence", "fallback", "parallel", "try", "invert", "succeed",
)  # fmt: skip
_BLOCKS = ("retry", "repeat", "while", "for_each", "timeout", "catch")


class Draft:
    """The data of one file, changed in place, and the chance that decides how.

    Attributes:
        rng: Decides everything.
        data: What is changed.
        skills: Installed skills by name.
        words: The words that stood in the file at first.
        variables: The names of all ports, and two that nothing has.
    """

    def __init__(self, rng: random.Random, data: Any, skills: Mapping[str, type[Skill]]) -> None:
        self.rng, self.data, self.skills = rng, data, skills
        words = {str(word) for container, key in places(data) for word in (key, container[key])}
        self.words = sorted(word for word in words if re.fullmatch(r"[$\w.]+", word))
        self.variables = [*sorted({port for skill in skills.values() for port in skill.ports}), "x", "y"]

    @property
    def trees(self) -> Mapping[str, Any]:
        """The file's subtrees by name; none where there is no mapping of them."""
        trees = self.data.get("trees")
        return trees if isinstance(trees, dict) else {}

    def nodes(self, suits: Callable[[Any], Any] = lambda node: True) -> list[Place]:
        """Return where every node stands that suits, parents before children."""
        found = list(_nodes(self.data, "tree")) if "tree" in self.data else []
        for name, tree in self.trees.items():
            written_out = isinstance(tree, dict) and "do" in tree
            found += _nodes(tree, "do") if written_out else _nodes(self.trees, name)
        return [(container, key) for container, key in found if suits(container[key])]

    def steps(self) -> list[Place]:
        """Return where every node stands that is one of a list."""
        return [place for place in self.nodes() if isinstance(place[0], list)]

    def skill_of(self, node: Any) -> str:
        """Return the name of the skill that a node is, or ""."""
        named = node if isinstance(node, str) else next(iter(node), "") if isinstance(node, dict) else ""
        return named if named in self.skills else ""

    def leaf(self) -> Any:
        """Return a node: one of the mission's own again, or a skill, half of which can stand anywhere."""
        mine = self.nodes()
        if self.rng.random() < 0.3 and mine:
            container, key = self.rng.choice(mine)
            return deepcopy(container[key])
        skills = self.skills.items()
        free = [name for name, skill in skills if not any(port.required for port in skill.ports.values())]
        name = self.rng.choice(self.rng.choice((["succeed", *free], list(self.skills))))
        if name not in self.skills:
            return name
        settings = self.settings(name, self.rng.choice((0, 0, 1, 2)))
        return {name: settings} if settings else name

    def settings(self, name: str, count: int) -> dict[str, Any]:
        """Return some settings of a skill, and those it must have."""
        skill = self.skills[name]
        declared: list[Param | Port] = [*skill.params.values(), *skill.ports.values()]
        needed = [one for one in declared if isinstance(one, Param) and one.required]
        chosen = [*needed, *self.rng.sample(declared, min(count, len(declared)))]
        return {one.name: self._setting(one) for one in chosen}

    def _setting(self, declared: Param | Port) -> Any:
        rng = self.rng
        if rng.random() < 0.1:
            return deepcopy(rng.choice(ODD_VALUES))
        if isinstance(declared, Param):
            likely = [*(declared.choices or ()), declared.ge, declared.le, declared.default, 1, 0.2, "next"]
            return rng.choice([value for value in likely if value is not None and value is not ...])
        if declared.direction is Direction.IN and is_plain(declared.type) and rng.random() < 0.3:
            return rng.choice(self.words)
        ports = [port for skill in self.skills.values() for port in skill.ports.values()]
        alike = [port.name for port in ports if (port.type, port.refers) == (declared.type, declared.refers)]
        return f"${rng.choice(rng.choice((alike, alike, self.variables)))}"

    def reasons(self, node: Any) -> list[str]:
        """Return what may fail in a node by the names of skills and labels, at least one name."""
        found = list(places([node]))
        used = {str(word) for container, key in found for word in (key, container[key])}
        for name in sorted(used & set(self.trees)):
            used |= {
                str(word) for container, key in places([self.trees[name]]) for word in (key, container[key])
            }
        names = [
            f"{name}.{reason}"
            for name in sorted(used & set(self.skills))
            for reason in self.skills[name].reasons
        ]
        labels = [container[key] for container, key in found if key == "as"]
        names += [f"{label}.{name.partition('.')[2]}" for label in labels for name in names]
        return names or ["timeout.timeout"]

    def some_reasons(self, node: Any) -> list[str]:
        """Return one to three things that may fail in a node."""
        names = self.reasons(node)
        return self.rng.sample(names, self.rng.randint(1, min(3, len(names))))

    def arguments(self, name: Any) -> list[str]:
        """Return the names of the arguments of a subtree."""
        tree = self.trees.get(name) if isinstance(name, str) else None
        given = tree.get("args") if isinstance(tree, dict) else None
        return [str(argument) for argument in given] if isinstance(given, dict | list) else []


def places(data: Any) -> Iterator[Place]:
    """Yield where every value below `data` stands."""
    for key in list(data) if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ():
        yield data, key
        yield from places(data[key])


def inside(node: Any) -> list[Place]:
    """Return where every node below a node stands."""
    return list(_below(node, _BODIES))


def _nodes(container: Any, key: Any) -> Iterator[Place]:
    yield container, key
    yield from _below(container[key], _BODIES)


def _below(value: Any, bodies: tuple[str, ...]) -> Iterator[Place]:
    if isinstance(value, list):
        for index in range(len(value)):
            yield from _nodes(value, index)
    for key in list(value) if isinstance(value, dict) else ():
        inner = value[key]
        if key in _BLOCKS or (key == "parallel" and isinstance(inner, dict)):
            for block in inner if isinstance(inner, list) else [inner]:
                yield from _below(block, ("do", "recover", "condition")) if isinstance(block, dict) else ()
        elif key in bodies:
            yield from _nodes(value, key)
