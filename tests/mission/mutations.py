"""Mutations of a mission file: of its data, which keep it YAML, and of its text, which need not."""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from copy import deepcopy
from typing import Any

Place = tuple[Any, Any]
"""A list or mapping, and the index or key in it of what stands there."""

ODD_VALUES: tuple[Any, ...] = (
    None, True, False, 0, 1, 2, -1, 3, 0.5, 1e-9, 1e300, -1e300, 10**40, float("nan"), float("inf"), "",
    " ", "$", "$$", "$x", "$$x", "$a.b", "text", "auto", "Detect", "Grasp.missed", "a: b", "\n", "\u2028x",
    "\ud800", "x" * 300,
    [], [[]], [None], [1, "a", None], {}, {"do": None}, {"a": {"b": [{}]}}, ["succeed"], "succeed",
)  # fmt: skip

ODD_TEXTS = (
    "&a ", "*a", "!!int ", "!!python/object:os.system ", "<<: ", "\t", "\r", "\0", "\ufeff", "\u2028",
    "---\n", "...\n", "%YAML 1.1\n", "{", "}", "[", "]", '"', "'", "|", ">", "- ", "? ", ": ", ", ", "# ",
    "@", "`", "\\", "\n", "\n\n  ", "0x" + "f" * 290, "1e999", "-.inf", ".nan", "0o17", "1_000", "~", "yes",
    "\U0001f980", "\x85", '"\\ud800"', '"\\0"', "x" * 300,
)  # fmt: skip

BODIES = ("do", "tree", "recover", "condition", "finally", "sequence", "fallback", "try", "invert", "succeed")
"""Keys below which a node or a list of nodes stands."""


def places(data: Any) -> Iterator[Place]:
    """Yield where every value below `data` stands."""
    for container, key, _ in roles(data):
        yield container, key


def roles(data: Any, role: str = "") -> Iterator[tuple[Any, Any, str]]:
    """Yield where every value below `data` stands, and the key that it or its list stands under."""
    for key in list(data) if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ():
        inner = str(key) if isinstance(data, dict) else role
        yield data, key, inner
        yield from roles(data[key], inner)


class Draft:
    """The data of one file, changed in place, and the chance that decides how.

    Args:
        rng: Decides everything.
        data: What is changed.
        pool: What stands under each key in some good files, and for lists also each element.
    """

    def __init__(self, rng: random.Random, data: Any, pool: Mapping[str, Sequence[Any]]) -> None:
        self.rng, self.data, self.pool = rng, data, pool
        texts = (str(word) for container, key in places(data) for word in (key, container[key]))
        self.words = sorted({word for word in texts if re.fullmatch(r"[$\w.]+", word)})

    def mutate(self) -> None:
        """Change one thing, or nothing where there is nothing of the kind to change."""
        changes = (self.delete, self.insert, self.move, self.graft, self.wrap, self.swap, self.rename)
        rarer = (self.retype, self.nest, self.count)
        self.rng.choices((*changes, *rarer), (3, 5, 4, 12, 8, 2, 3, 2, 1, 3))[0]()

    def _choose(self, suits: Callable[[Any, Any, str], bool]) -> tuple[Any, Any, str] | None:
        found = [place for place in roles(self.data) if suits(*place)]
        return self.rng.choice(found) if found else None

    def _step(self) -> tuple[Any, Any, str] | None:
        return self._choose(lambda container, key, role: isinstance(container, list) and role in BODIES)

    def delete(self) -> None:
        if found := self.rng.choice((self._step, lambda: self._choose(lambda *place: True)))():
            del found[0][found[1]]

    def insert(self) -> None:
        if found := self._step():
            container, index, role = found
            new = self.rng.choice((*self.pool.get(role, ()), container[index]))
            # Sometimes the very same object, which is written as an anchor and an alias.
            again = new if self.rng.random() < 0.1 else deepcopy(new)
            container[index : index + 1] = self.rng.sample([container[index], again], 2)

    def move(self) -> None:
        if found := self._step():
            node = found[0].pop(found[1])
            container, index, _ = self._step() or found
            container.insert(index + self.rng.randrange(2), node)

    def graft(self) -> None:
        """Put in the place of a value another one that stands under the same key in a good file."""
        if found := self._choose(lambda container, key, role: role in self.pool):
            container, key, role = found
            container[key] = deepcopy(self.rng.choice(self.pool[role]))

    def wrap(self) -> None:
        if found := self._choose(lambda container, key, role: role in BODIES):
            container, key, _ = found
            container[key] = self._wrapped(deepcopy(container[key]))

    def swap(self) -> None:
        found = list(places(self.data))
        if len(found) > 1:
            (one, i), (other, j) = self.rng.sample(found, 2)
            # Of two that stand one inside the other, the inner one takes the place of both.
            one[i], other[j] = deepcopy(other[j]), deepcopy(one[i])

    def rename(self) -> None:
        if found := self._choose(lambda container, key, role: isinstance(key, str)):
            container, key, _ = found
            if isinstance(container[key], str) and self.rng.random() < 0.7:
                container[key] = self._other(container[key])
                return
            entries = [(self._other(k) if k == key else k, value) for k, value in container.items()]
            container.clear()
            container.update(entries)

    def retype(self) -> None:
        if found := self._choose(lambda *place: True):
            found[0][found[1]] = deepcopy(self.rng.choice(ODD_VALUES))

    def nest(self) -> None:
        if found := self._choose(lambda *place: True):
            for _ in range(self.rng.choice((1, 1, 2, 20, 70))):
                value = found[0][found[1]]
                found[0][found[1]] = self.rng.choice(({"succeed": value}, [value]))

    def count(self) -> None:
        if found := self._choose(lambda container, key, role: type(container[key]) in (int, float)):
            value = found[0][found[1]]
            found[0][found[1]] = self.rng.choice((0, 1, 2, 5, 20, 0.05, 0.5, -value, value * 2))

    def _other(self, word: str) -> str:
        """Return the word misspelt, or another of the file, of the same form if there is one."""
        if self.rng.random() < 0.3 and word:
            at = self.rng.randrange(len(word))
            return word[:at] + self.rng.choice(("", "x", "X", " ", word[at] * 2)) + word[at + 1 :]

        def form(text: str) -> tuple[bool, bool, bool]:
            return text[:1] == "$", "." in text, text[:1].isupper()

        return self.rng.choice([known for known in self.words if form(known) == form(word)] or self.words)

    def _wrapped(self, node: Any) -> Any:
        """Return a node inside a random control node."""
        rng, other, some = self.rng, deepcopy(self.rng.choice(self.pool["do"])), self.rng.randint(1, 3)
        pair, on = rng.choice(([node, other], [other, node])), deepcopy(rng.choice(self.pool["on"]))
        each = rng.choice(("wanted", "target", "item", "bin", "x"))
        elements = rng.choice((["a", None], [], [1, 2], ["cube", "duck"], "$targets", "$x"))
        waiting = {"wait_for": rng.choice(("any", "all", "lead")), "halt": rng.random() < 0.5}
        shapes: tuple[Any, ...] = (
            {"sequence": pair}, {"fallback": pair}, {"invert": node}, {"succeed": node},
            {"parallel": pair}, {"parallel": {**waiting, "do": pair}},
            {"retry": {"attempts": some, "do": node}},
            {"retry": {"attempts": some, "on": on, "recover": other, "do": node}},
            {"repeat": {"times": some, "do": node}}, {"repeat": {"until": on, "do": node}},
            {"while": {"condition": pair[0], "do": pair[1]}},
            {"for_each": {"each": each, "in": elements, "do": rng.choice((node, [other, node]))}},
            {"try": node, "catch": [{"on": on, "do": other}]}, {"try": node, "finally": other},
            {"timeout": {"seconds": rng.choice((0.05, 1, 2.5, 30)), "do": node}},
        )  # fmt: skip
        return rng.choice(shapes)


def mutate_text(rng: random.Random, text: str) -> str:
    """Return a text with a character, a word or a line changed, or cut off somewhere."""
    at = rng.randrange(len(text) + 1)
    lines = text.splitlines(keepends=True) or [""]
    line = rng.randrange(len(lines))
    some, odd = rng.choice(lines), rng.choice(ODD_TEXTS)
    changed = rng.choice(
        ([], [lines[line]] * 2, [some], ["  " + lines[line]], ["\t" + lines[line]], [lines[line].lstrip(" ")])
    )
    word = rng.choice(list(re.finditer(r"[\w.$]+", text)) or [re.match("", text)])
    return rng.choice(
        (
            text[:at] + text[at + 1 :],
            text[:at] + text[at : at + 1] + text[at:],
            text[:at] + text[at : at + 2][::-1] + text[at + 2 :],
            text[:at] + odd + text[at:],
            text[:at],
            text[: word.start()] + odd + text[word.end() :],
            *["".join([*lines[:line], *changed, *lines[line + 1 :]])] * 5,
        )
    )
