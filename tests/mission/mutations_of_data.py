"""Mutations of a mission's data: its nodes, words, values, wires, reasons and declarations.

Each changes the draft and tells whether there was anything for it to change. About half of them are
such that the mission may still be a good one.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from copy import deepcopy
from typing import Any

from draft import ODD_VALUES, Draft, inside, places

_BACKOFFS: tuple[Any, ...] = ({}, {}, {"backoff": 0.3}, {"backoff": {"first": 0.1, "factor": 2, "most": 1}})


def delete(draft: Draft) -> bool:
    found = draft.rng.choice((draft.nodes(), draft.steps(), draft.steps()))
    if found:
        container, key = draft.rng.choice(found)
        del container[key]
    return bool(found)


def double(draft: Draft) -> bool:
    if found := draft.steps():
        container, index = draft.rng.choice(found)
        # Sometimes the very same object, which is written as an anchor and an alias.
        again = container[index] if draft.rng.random() < 0.3 else deepcopy(container[index])
        container.insert(draft.rng.randrange(len(container) + 1), again)
    return bool(found)


def swap(draft: Draft) -> bool:
    if len(found := draft.nodes()) > 1:
        (one, i), (other, j) = draft.rng.sample(found, 2)
        # Of two that stand one inside the other, the inner one takes the place of both.
        one[i], other[j] = deepcopy(other[j]), deepcopy(one[i])
    return len(found) > 1


def move(draft: Draft) -> bool:
    if len(found := draft.steps()) > 1:
        container, index = draft.rng.choice(found)
        node = container.pop(index)
        container, index = draft.rng.choice(draft.steps() or [(container, 0)])
        container.insert(index + draft.rng.randrange(2), node)
    return len(found) > 1


def insert(draft: Draft) -> bool:
    if found := draft.steps():
        container, index = draft.rng.choice(found)
        container.insert(index + draft.rng.randrange(2), draft.leaf())
    return bool(found)


def replace(draft: Draft) -> bool:
    if found := draft.nodes():
        container, key = draft.rng.choice(found)
        container[key] = draft.leaf()
    return bool(found)


def wrap(draft: Draft) -> bool:
    if found := draft.nodes():
        container, key = draft.rng.choice(found)
        container[key] = _wrapped(draft, deepcopy(container[key]))
    return bool(found)


def unwrap(draft: Draft) -> bool:
    if found := draft.nodes(inside):
        container, key = draft.rng.choice(found)
        part, where = draft.rng.choice(inside(container[key]))
        container[key] = part[where]
    return bool(found)


def label(draft: Draft) -> bool:
    if found := draft.nodes(lambda node: isinstance(node, dict)):
        container, key = draft.rng.choice(found)
        container[key]["as"] = draft.rng.choice(("one", "two", "two", "look", "Bad", "retry"))
    return bool(found)


def rename(draft: Draft) -> bool:
    found = [(c, k) for c, k in places(draft.data) if isinstance(k, str) or isinstance(c[k], str)]
    if found:
        container, key = draft.rng.choice(found)
        if isinstance(key, str) and (not isinstance(container[key], str) or draft.rng.random() < 0.5):
            entries = [(_other(draft, k) if k == key else k, value) for k, value in container.items()]
            container.clear()
            container.update(entries)
        else:
            container[key] = _other(draft, container[key])
    return bool(found)


def retype(draft: Draft) -> bool:
    return _revalue(draft, lambda value: deepcopy(draft.rng.choice(ODD_VALUES)))


def copy(draft: Draft) -> bool:
    container, key = draft.rng.choice(list(places(draft.data)))
    return _revalue(draft, lambda value: deepcopy(container[key]))


def nest(draft: Draft) -> bool:
    def nested(value: Any) -> Any:
        for _ in range(draft.rng.choice((1, 1, 2, 20, 70))):
            value = draft.rng.choice(({"succeed": value}, [value]))
        return value

    return _revalue(draft, nested)


def count(draft: Draft) -> bool:
    def near(value: Any) -> Any:
        return draft.rng.choice((0, 1, 2, 5, 20, 0.05, 0.5, -value, value * 2))

    return _revalue(draft, near, lambda value: type(value) in (int, float))


def forget(draft: Draft) -> bool:
    if found := [(c, k) for c, k in places(draft.data) if isinstance(c, dict)]:
        container, key = draft.rng.choice(found)
        del container[key]
    return bool(found)


def wire(draft: Draft) -> bool:
    if found := draft.nodes(draft.skill_of):
        container, key = draft.rng.choice(found)
        node, name = container[key], draft.skill_of(container[key])
        given = node[name] if isinstance(node, dict) and isinstance(node[name], dict) else {}
        kept = {"as": node["as"]} if isinstance(node, dict) and "as" in node else {}
        container[key] = {name: {**given, **draft.settings(name, 1)}, **kept}
    return bool(found)


def expect(draft: Draft) -> bool:
    found = [(c, k) for c, k in places(draft.data) if k in ("on", "until")]
    if found:
        container, key = draft.rng.choice(found)
        listed = container[key] if isinstance(container[key], list) else [container[key]]
        likely = [*draft.reasons(container), *draft.reasons(container), *draft.some_reasons(draft.data)]
        new = draft.rng.choice([*likely, "timeout.timeout", "Detect.nonsense", "Grasp"])
        kept = [reason for reason in listed if draft.rng.random() < 0.8]
        container[key] = draft.rng.choice(([*kept, new], [*kept, new], kept, new))
    return bool(found)


def give(draft: Draft) -> bool:
    """Change what a subtree is used with, or use one in another place."""
    uses = draft.nodes(lambda node: isinstance(node, dict) and "use" in node)
    found, again = draft.steps(), draft.rng.random() < 0.3
    if not uses or not found:
        return False
    container, key = draft.rng.choice(uses)
    node, rng = deepcopy(container[key]), draft.rng
    known = draft.arguments(node["use"]) or ["view", "pose", "attempts", "to"]
    values = (rng.choice(draft.words), f"${rng.choice(draft.variables)}", rng.choice((1, 2, "full", "next")))
    given = node.get("with")
    if rng.random() < 0.6:
        node["with"] = {**(given if isinstance(given, dict) else {}), rng.choice(known): rng.choice(values)}
    else:
        node["returns"] = {rng.choice(("targets", *draft.variables)): f"${rng.choice(draft.variables)}"}
    if again:
        container, key = rng.choice(found)
        container.insert(key, node)
    else:
        container[key] = node
    return True


def declare(draft: Draft) -> bool:
    part = draft.rng.choice(("params", "routes", "trees"))
    section = draft.data.get(part)
    if not isinstance(section, dict) or not section:
        return False
    name = draft.rng.choice(list(section))
    section[name] = {"params": _param, "routes": _route, "trees": _tree}[part](draft, section[name])
    return True


def _revalue(
    draft: Draft, other: Callable[[Any], Any], suits: Callable[[Any], bool] = lambda value: True
) -> bool:
    if found := [(container, key) for container, key in places(draft.data) if suits(container[key])]:
        container, key = draft.rng.choice(found)
        container[key] = other(container[key])
    return bool(found)


def _other(draft: Draft, word: str) -> str:
    """Return the word misspelt, or another of the file, of the same form if there is one."""
    if draft.rng.random() < 0.3 and word:
        at = draft.rng.randrange(len(word))
        return word[:at] + draft.rng.choice(("", "x", "X", " ", word[at] * 2)) + word[at + 1 :]

    def form(text: str) -> tuple[bool, bool, bool]:
        return text[:1] == "$", "." in text, text[:1].isupper()

    alike = [known for known in draft.words if form(known) == form(word)]
    return draft.rng.choice(alike or draft.words)


def _param(draft: Draft, value: Any) -> Any:
    declared = dict(value) if isinstance(value, dict) else {"default": value}
    more = {
        "type": draft.rng.choice(("text", "integer", "number", "boolean", "list")),
        "min": draft.rng.choice((0, 1, 5)),
        "max": draft.rng.choice((1, 5, 60.5)),
        "choices": [declared.get("default"), 2],
    }
    key = draft.rng.choice(list(more))
    return {**declared, key: more[key]}


def _route(draft: Draft, bins: Any) -> Any:
    routes = [bin for listed in draft.data["routes"].values() for bin in _listed(listed)]
    another = draft.rng.choice([*routes, "nowhere"])
    return draft.rng.choice(([*_listed(bins), another], another))


def _tree(draft: Draft, tree: Any) -> Any:
    tree = tree if isinstance(tree, dict) and "do" in tree else {"do": tree}
    names = draft.rng.sample(draft.variables, draft.rng.randrange(4))
    defaults = {name: draft.rng.choice(draft.words) for name in names}
    key = draft.rng.choice(("args", "returns"))
    return {**tree, key: draft.rng.choice((names, defaults)) if key == "args" else names}


def _listed(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


def _wrapped(draft: Draft, node: Any) -> Any:
    """Return a node inside a random control node; what else that needs suits it more often than not."""
    rng, other = draft.rng, draft.leaf()
    pair = rng.choice(([node, other], [other, node]))
    on, some, backoff = draft.some_reasons(node), rng.randint(1, 3), rng.choice(_BACKOFFS)
    each = rng.choice(("wanted", "target", "item", "bin", "x"))
    elements = rng.choice((["a", None], [], [1, 2], ["cube", "duck"], "$targets", "$targets", "$x"))
    loop = {"for_each": {"each": each, "in": elements, "do": rng.choice((node, "succeed", [other, node]))}}
    shapes: tuple[Any, ...] = (
        {"sequence": pair},
        {"fallback": pair},
        {"parallel": pair},
        {"parallel": rng.choice(([loop, other], [node, loop], [other, loop, {"Wait": {"seconds": 0.1}}]))},
        {
            "parallel": {
                "wait_for": rng.choice(("any", "all", "lead")),
                "halt": rng.random() < 0.5,
                "do": pair,
            }
        },
        {"retry": {"attempts": some, **rng.choice(({}, {"on": on})), **backoff, "do": node}},
        {"retry": {"attempts": some, "on": on, **backoff, "recover": other, "do": node}},
        {"repeat": {"times": some, "do": node}},
        {"repeat": {**rng.choice(({}, {"times": some})), "until": on, "do": node}},
        {"while": {"condition": pair[0], "do": pair[1]}},
        loop,
        {"try": node, "catch": [{"on": on, "do": other}]},
        {"try": node, "catch": [{"on": on, "do": "succeed"}], "finally": other},
        {"try": node, "finally": other},
        {"timeout": {"seconds": rng.choice((0.05, 1, 2.5, 30)), "do": node}},
        {"invert": node},
        {"succeed": node},
    )
    return rng.choice(shapes)


OF_DATA: Mapping[Callable[[Draft], bool], int] = {
    delete: 4, double: 3, swap: 3, move: 4, insert: 6, replace: 2, wrap: 14, unwrap: 3, label: 3,
    rename: 4, retype: 3, copy: 1, nest: 1, count: 4, forget: 2, wire: 9, expect: 7, give: 4, declare: 6,
}  # fmt: skip
"""Every mutation, and how often it is made, relative to the others."""
