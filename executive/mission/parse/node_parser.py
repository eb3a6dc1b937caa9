"""Parser of the nodes of a mission's tree from YAML words, lists and mappings."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

from executive.mission.findings import Finding, list_choices, make_error
from executive.mission.model import grammar
from executive.mission.model import nodes as model
from executive.mission.parse.control import (
    ControlEntry,
    find_inner_keys,
    find_shorthand_key,
    make_unknown_node,
    read_control_node,
)
from executive.mission.parse.fields import read_settings
from executive.mission.source import Mark
from executive.mission.text.yaml_text import (
    YamlEntry,
    YamlMapping,
    YamlNode,
    YamlScalar,
    YamlSequence,
    describe_node,
)
from executive.skill import Skill
from executive.tree.node_registry import ControlNodes

Skills = Mapping[str, type[Skill]]
"""Installed skills by name."""
_LABEL_PATTERN = re.compile(grammar.LABEL_PATTERN)
_SKILL_PATTERN = re.compile(r"[A-Z][A-Za-z0-9]*")


class NodeParser:
    """Parser of the nodes in a mission or library file, which adds errors to `findings`.

    A node that cannot be read becomes an unknown node, so that parsing continues.
    """

    def __init__(self, findings: list[Finding], skills: Skills, node_classes: ControlNodes) -> None:
        self.findings, self._skills, self._node_classes = findings, skills, node_classes
        self._keywords = [*node_classes, grammar.USE_KEYWORD]

    def make_silent_parser(self) -> NodeParser:
        """Return a parser whose errors are discarded."""
        return NodeParser([], self._skills, self._node_classes)

    def read_node(self, node: YamlNode | None, mark: Mark) -> model.Node:
        """Return a node of the tree; an unknown node at `mark` if the YAML node is missing or empty."""
        if node is None or (isinstance(node, YamlScalar) and node.value is None):
            if node is not None:
                self.add_error(mark, "missing-node", "a node is missing here")
            return make_unknown_node(mark)
        if isinstance(node, YamlSequence):
            return self._read_list(node)
        if isinstance(node, YamlScalar):
            return self._read_word(node)
        return self._read_mapping(node)

    def read_nodes(self, node: YamlNode, owner: str) -> tuple[model.Node, ...]:
        """Return the nodes of the list that `owner` must contain; () if it is no list."""
        if not isinstance(node, YamlSequence):
            message = f"{owner} must be a list of nodes, not {describe_node(node)}"
            self.add_error(node.mark, "wrong-type", message)
            return ()
        if not node.items:
            self.add_error(node.mark, "empty-list", f"{owner} needs at least one node")
        return tuple(self.read_node(item, item.mark) for item in node.items)

    def add_error(self, mark: Mark, code: str, message: str, hint: str = "") -> None:
        """Add an error to the findings."""
        self.findings.append(make_error(mark, code, message, hint))

    def _read_list(self, node: YamlSequence) -> model.Node:
        nodes = self.read_nodes(node, "a list of nodes")
        if not nodes:
            return make_unknown_node(node.mark)
        node_class = self._node_classes[grammar.SEQUENCE_KEYWORD]
        return model.InnerNode(node.mark, "", node_class, {"do": nodes}, is_list=True)

    def _read_word(self, node: YamlScalar) -> model.Node:
        word = node.text
        node_class = self._node_classes.get(word)
        shorthand = find_shorthand_key(node_class) if node_class is not None else None
        if node_class is not None and shorthand is not None and not shorthand.is_required:
            return model.InnerNode(node.mark, "", node_class, {})
        if isinstance(node.value, str) and _SKILL_PATTERN.fullmatch(word):
            return model.SkillNode(node.mark, "", word, {})
        if word in self._keywords:
            self.add_error(node.mark, "missing-node", f'"{word}" needs a body: write {word}: ...')
        else:
            self._add_keyword_error(node.mark, word)
        return make_unknown_node(node.mark)

    def _read_mapping(self, node: YamlMapping) -> model.Node:
        label = self._read_label(node)
        entries = [entry for entry in node.entries if entry.key.text != "as"]
        heads = [e for e in entries if e.key.text in self._keywords or _SKILL_PATTERN.fullmatch(e.key.text)]
        if not heads:
            for entry in entries:
                self._add_keyword_error(entry.key.mark, entry.key.text)
            if not entries:
                self.add_error(node.mark, "missing-node", "a node is missing here: the mapping names no node")
            return make_unknown_node(node.mark)
        head, *others = heads
        for entry in others:
            message = f'"{head.key.text}" and "{entry.key.text}" are two nodes in one mapping'
            self.add_error(entry.key.mark, "two-nodes", message, "Write a list to run one after the other.")
        if others:
            # Errors in the other nodes are not reported before each node has a mapping of its own.
            parts = [self.make_silent_parser()._read_head(node, other, "") for other in others]
            return model.UnknownNode(head.key.mark, label, (self._read_head(node, head, ""), *parts))
        name = head.key.text
        node_class = self._node_classes.get(name)
        siblings = [key.name for key in node_class.keys.values() if key.is_sibling] if node_class else []
        allowed = (name, "as", *(grammar.USE_SIBLINGS if name == grammar.USE_KEYWORD else siblings))
        for entry in entries:
            key = entry.key.text
            if entry not in heads and key not in allowed:
                is_inner_key = node_class is not None and key in find_inner_keys(node_class)
                hint = f"Indent {key}: it is a key below {name}." if is_inner_key else ""
                hint = hint or list_choices(key, allowed[1:], f"Keys at the level of {name}")
                message = f'"{key}" is not allowed at the level of "{name}"'
                self.add_error(entry.key.mark, "unknown-key", message, hint)
        result = self._read_head(node, head, label)
        return replace(result, label_mark=label_node.mark) if (label_node := node.get("as")) else result

    def _read_head(self, node: YamlMapping, head: YamlEntry, label: str) -> model.Node:
        """Return the node of a mapping; `head` is the entry with the keyword or skill."""
        name = head.key.text
        if name == grammar.USE_KEYWORD:
            return self._read_use(node, head, label)
        if name in self._node_classes:
            entry = ControlEntry(node, name, head.key.mark, label, head.value)
            return read_control_node(self, entry, self._node_classes[name])
        params = self._skills[name].params if name in self._skills else {}
        settings = read_settings(head.value, name, self.findings, next(iter(params), "name"))
        return model.SkillNode(head.key.mark, label, name, settings)

    def _read_use(self, node: YamlMapping, head: YamlEntry, label: str) -> model.Node:
        """Return the use of a subtree, or an unknown node if the name of the subtree is no text."""
        arguments, returns = (
            {} if (given := node.get(key)) is None else read_settings(given, key, self.findings)
            for key in grammar.USE_SIBLINGS
        )
        if not (isinstance(head.value, YamlScalar) and isinstance(head.value.value, str)):
            message = f"use must be the name of a subtree, not {describe_node(head.value)}"
            self.add_error(head.value.mark, "wrong-type", message)
            return make_unknown_node(head.key.mark)
        return model.UseNode(head.value.mark, label, head.value.text, arguments, returns)

    def _read_label(self, node: YamlMapping) -> str:
        value = node.get("as")
        if value is None:
            return ""
        is_text = isinstance(value, YamlScalar) and isinstance(value.value, str)
        text = value.text if isinstance(value, YamlScalar) else ""
        if is_text and _LABEL_PATTERN.fullmatch(text):
            return text
        given = f'"{text}"' if isinstance(value, YamlScalar) else describe_node(value)
        self.add_error(value.mark, "bad-label", f"a label must be a lower-case word, not {given}")
        return ""

    def _add_keyword_error(self, mark: Mark, word: str) -> None:
        """Add an error for a word that is no keyword and no skill."""
        skills_by_lower_case = {name.lower(): name for name in self._skills}
        skill = skills_by_lower_case.get(word.replace("_", "").replace(" ", "").lower())
        hints = dict(grammar.KEYWORD_HINTS)
        for name, node_class in self._node_classes.items():
            siblings = [key.name for key in node_class.keys.values() if key.is_sibling]
            hints |= {key: f"Write {key} at the level of {name}, not below {name}." for key in siblings}
            hints |= node_class.keyword_hints
        hint = hints.get(word) or (f'Did you mean the skill "{skill}"?' if skill else "")
        if not hint:
            keywords = list_choices(word, self._keywords, "Control nodes")
            hint = f"{keywords} A subtree is written as use: NAME."
        self.add_error(mark, "unknown-node", f'there is no control node "{word}"', hint)
