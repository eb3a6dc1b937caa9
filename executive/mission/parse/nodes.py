"""Parser of the nodes of a mission's tree from YAML words, lists and mappings."""

from __future__ import annotations

import re
from collections.abc import Mapping as SkillsByName
from dataclasses import replace

from executive.mission.findings import Finding, alternatives, error
from executive.mission.model import grammar
from executive.mission.model import nodes as model
from executive.mission.parse.control import (
    Head,
    find_inner_keys,
    find_shorthand_key,
    make_unknown_node,
    read_control,
)
from executive.mission.parse.fields import settings_of
from executive.mission.source import Mark
from executive.mission.text.yaml_text import Entry, Mapping, Node, Scalar, YamlSequence, plain
from executive.mission.words import describe
from executive.skill import Skill
from executive.tree.registry import ControlNodes

Skills = SkillsByName[str, type[Skill]]
_LABEL = re.compile(grammar.LABEL_PATTERN)
_SKILL = re.compile(r"[A-Z][A-Za-z0-9]*")


class NodeParser:
    """Reads the nodes of one mission file and adds errors to `findings`.

    A node that cannot be read becomes an unknown node, and the parser continues.
    """

    def __init__(self, findings: list[Finding], skills: Skills, control: ControlNodes) -> None:
        self.findings, self._skills, self._control = findings, skills, control
        self._words = [*control, grammar.USE]

    def make_silent_parser(self) -> NodeParser:
        """Return a parser whose findings are discarded."""
        return NodeParser([], self._skills, self._control)

    def node(self, node: Node | None, mark: Mark) -> model.Node:
        """Return a node of the tree, or an unknown node if it is missing."""
        if node is None or (isinstance(node, Scalar) and node.value is None):
            if node is not None:
                self.refuse(mark, "missing-node", "a node is missing here")
            return make_unknown_node(mark)
        if isinstance(node, YamlSequence):
            return self._read_list(node)
        if isinstance(node, Scalar):
            return self._read_word(node)
        return self._read_mapping(node)

    def nodes(self, node: Node, owner: str) -> tuple[model.Node, ...]:
        """Return the nodes of a list."""
        if not isinstance(node, YamlSequence):
            self.refuse(
                node.mark, "wrong-type", f"{owner} takes a list of nodes, not {describe(plain(node))}"
            )
            return ()
        if not node.items:
            self.refuse(node.mark, "empty-list", f"{owner} needs at least one node")
        return tuple(self.node(item, item.mark) for item in node.items)

    def refuse(self, mark: Mark, code: str, message: str, hint: str = "") -> None:
        """Record an error."""
        self.findings.append(error(mark, code, message, hint))

    def _read_list(self, node: YamlSequence) -> model.Node:
        steps = self.nodes(node, "a list of steps")
        kind = self._control[grammar.SEQUENCE]
        return (
            model.InnerNode(node.mark, "", kind, {"do": steps}, is_list=True)
            if steps
            else make_unknown_node(node.mark)
        )

    def _read_word(self, node: Scalar) -> model.Node:
        word = node.text
        kind = self._control.get(word)
        if kind is not None and (bare := find_shorthand_key(kind)) is not None and not bare.is_required:
            return model.InnerNode(node.mark, "", kind, {})
        if isinstance(node.value, str) and _SKILL.fullmatch(word):
            return model.SkillNode(node.mark, "", word, {})
        if word in self._words:
            self.refuse(node.mark, "missing-node", f'"{word}" needs a body: write {word}: ...')
        else:
            self._refuse_word(node.mark, word)
        return make_unknown_node(node.mark)

    def _read_mapping(self, node: Mapping) -> model.Node:
        label = self._read_label(node)
        words = [entry for entry in node.entries if entry.key.text != "as"]
        heads = [e for e in words if e.key.text in self._words or _SKILL.fullmatch(e.key.text)]
        if not heads:
            for entry in words:
                self._refuse_word(entry.key.mark, entry.key.text)
            if not words:
                self.refuse(node.mark, "missing-node", "a node is missing here: the mapping names none")
            return make_unknown_node(node.mark)
        head, *others = heads
        for entry in others:
            message = f'"{head.key.text}" and "{entry.key.text}" stand in one node; a node has one name'
            self.refuse(entry.key.mark, "two-nodes", message, "Write a list to run one after the other.")
        if others:
            # Errors in the other nodes are not reported until each node stands alone.
            parts = [self.make_silent_parser()._read_head(node, other, "") for other in others]
            return model.UnknownNode(head.key.mark, label, (self._read_head(node, head, ""), *parts))
        name = head.key.text
        kind = self._control.get(name)
        siblings = [key.name for key in kind.keys.values() if key.is_sibling] if kind else []
        allowed = (name, "as", *(grammar.USE_SIBLINGS if name == grammar.USE else siblings))
        for entry in words:
            if entry not in heads and entry.key.text not in allowed:
                inside = kind is not None and entry.key.text in find_inner_keys(kind)
                hint = f"Indent it: it stands below {name}." if inside else ""
                hint = hint or alternatives(entry.key.text, allowed[1:], f"Beside {name} may stand")
                message = f'"{entry.key.text}" may not stand beside "{name}"'
                self.refuse(entry.key.mark, "unknown-key", message, hint)
        read = self._read_head(node, head, label)
        return replace(read, label_mark=written.mark) if (written := node.get("as")) else read

    def _read_head(self, node: Mapping, head: Entry, label: str) -> model.Node:
        """Return the node of a keyword or skill in a mapping, with the sibling keys."""
        name = head.key.text
        if name == grammar.USE:
            return self._read_use(node, head, label)
        if name in self._control:
            control = Head(node, name, head.key.mark, label, head.value)
            return read_control(self, control, self._control[name])
        known = self._skills[name].params if name in self._skills else {}
        settings = settings_of(head.value, name, self.findings, next(iter(known), "name"))
        return model.SkillNode(head.key.mark, label, name, settings)

    def _read_use(self, node: Mapping, head: Entry, label: str) -> model.Node:
        """Return the use of a subtree."""
        arguments, returns = (
            {} if (given := node.get(key)) is None else settings_of(given, key, self.findings)
            for key in grammar.USE_SIBLINGS
        )
        if not (isinstance(head.value, Scalar) and isinstance(head.value.value, str)):
            message = f"use takes the name of a subtree, not {describe(plain(head.value))}"
            self.refuse(head.value.mark, "wrong-type", message)
            return make_unknown_node(head.key.mark)
        return model.UseNode(head.value.mark, label, head.value.text, arguments, returns)

    def _read_label(self, node: Mapping) -> str:
        written = node.get("as")
        if written is None:
            return ""
        if isinstance(written, Scalar) and isinstance(written.value, str) and _LABEL.fullmatch(written.text):
            return written.text
        shown = f'"{written.text}"' if isinstance(written, Scalar) else describe(plain(written))
        message = f"a label is a lower-case word, not {shown}"
        self.refuse(written.mark, "bad-label", message)
        return ""

    def _refuse_word(self, mark: Mark, word: str) -> None:
        alike = {name.lower(): name for name in self._skills}
        skill = alike.get(word.replace("_", "").replace(" ", "").lower())
        elsewhere = dict(grammar.KEYWORD_HINTS)
        for name, kind in self._control.items():
            siblings = [key.name for key in kind.keys.values() if key.is_sibling]
            elsewhere |= dict.fromkeys(siblings, f"It stands beside {name}, not below it.")
            elsewhere |= kind.keyword_hints
        hint = elsewhere.get(word) or (f'Did you mean the skill "{skill}"?' if skill else "")
        if not hint:
            known = alternatives(word, self._words, "Control nodes are")
            hint = f"{known} A subtree is written as use: NAME."
        self.refuse(mark, "unknown-node", f'there is no control node "{word}"', hint)
