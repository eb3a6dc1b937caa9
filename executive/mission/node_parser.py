"""Parser of the nodes of a mission's tree from YAML scalars, sequences and mappings."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import replace

from executive.behaviours import Skills, load_behaviour
from executive.errors import InputError
from executive.mission import grammar
from executive.mission.grammar import NAME_PATTERN, MappingReader, is_empty, read_settings, read_value
from executive.skill import Skill
from executive.text.findings import Finding, Span, make_error, suggest_choice
from executive.text.yaml_files import YamlEntry, YamlMapping, YamlNode, YamlScalar, YamlSequence
from executive.tree.expression import read_expression, read_template
from executive.tree.keys import (
    Children,
    Key,
    KeyOwner,
    KeySection,
    KeyValue,
    OwnerT,
    list_member_types,
    list_nodes,
)
from executive.tree.node import ControlNode, ControlNodes
from executive.tree.specification import (
    Child,
    Constant,
    Expression,
    InvalidNode,
    InvalidValue,
    LocatedName,
    Node,
    Reference,
    SkillNode,
    SubtreeNode,
    Value,
    VariableName,
)

_SKILL_PATTERN = re.compile(r"[A-Z][A-Za-z0-9]*")
"""Matches the names of skills, also of skills that are not installed."""
EXPRESSION_PATTERN = re.compile(r"[$<>=+*/%(]|^(run|bin|not)\b")
"""Matches in a condition that is an expression, and in no name of a skill or control node."""


class NodeParser:
    """Parser of nodes, which adds errors to `findings` and returns `InvalidNode`s for invalid YAML nodes.

    Attributes:
        behaviours: Skill classes made from the py_trees behaviours in the tree, by class name.
    """

    def __init__(self, findings: list[Finding], skills: Skills, node_classes: ControlNodes) -> None:
        self.findings = findings
        self._skills = skills
        self._node_classes = node_classes
        self.behaviours: dict[str, type[Skill]] = {}
        self._keywords = [*node_classes, grammar.USE_KEYWORD, grammar.BEHAVIOUR_KEYWORD]

    def make_silent_parser(self) -> NodeParser:
        """Return a parser whose errors are discarded."""
        parser = NodeParser([], self._skills, self._node_classes)
        parser.behaviours = self.behaviours
        return parser

    def read_node(self, yaml_node: YamlNode | None, span: Span) -> Node:
        """Return the mission node for `yaml_node`; if it is missing or empty, an invalid node at `span`."""
        if yaml_node is None or is_empty(yaml_node):
            if yaml_node is not None:
                self.add_error(span, "missing-node", "a node is missing here")
            return InvalidNode(span=span)
        if isinstance(yaml_node, YamlSequence):
            return self._read_list(yaml_node)
        if isinstance(yaml_node, YamlScalar):
            return self._read_scalar(yaml_node)
        return self._read_mapping(yaml_node)

    def read_nodes(self, yaml_node: YamlNode, owner: str) -> tuple[Node, ...]:
        """Return the nodes of a list; for other values, add an error with the name `owner` and return ()."""
        if not isinstance(yaml_node, YamlSequence):
            message = f"{owner} must be a list of nodes, not {yaml_node.description}"
            self.add_error(yaml_node.span, "wrong-type", message)
            return ()
        if not yaml_node.items:
            self.add_error(yaml_node.span, "empty-list", f"{owner} needs at least one node")
        return tuple(self.read_node(item, item.span) for item in yaml_node.items)

    def add_error(self, span: Span, code: str, message: str, hint: str = "") -> None:
        """Add an error to the findings."""
        self.findings.append(make_error(span, code, message, hint))

    def _read_list(self, sequence: YamlSequence) -> Node:
        nodes = self.read_nodes(sequence, "a list of nodes")
        if not nodes:
            return InvalidNode(span=sequence.span)
        node_class = self._node_classes[grammar.SEQUENCE_KEYWORD]
        return node_class.make({}, span=sequence.span, do=nodes, is_list=True)

    def _read_scalar(self, scalar: YamlScalar) -> Node:
        """Return the mission node for a YAML scalar: a skill, or a keyword that needs no body."""
        word = scalar.text
        node_class = self._node_classes.get(word)
        if node_class is not None and node_class.is_value_optional():
            return node_class.make({}, span=scalar.span)
        if word in self._keywords:
            self.add_error(scalar.span, "missing-node", f'"{word}" needs a body: write {word}: ...')
        elif isinstance(scalar.value, str) and _SKILL_PATTERN.fullmatch(word):
            return SkillNode.model_construct(span=scalar.span, skill=word, settings={})
        elif isinstance(scalar.value, str) and EXPRESSION_PATTERN.search(word):
            condition = self._node_classes[grammar.CONDITION_KEYWORD]
            value = read_expression(word, scalar.span, self.findings)
            return condition.make({grammar.CONDITION_KEYWORD: value}, span=scalar.span)
        else:
            self._add_keyword_error(scalar.span, word)
        return InvalidNode(span=scalar.span)

    def _read_mapping(self, mapping: YamlMapping) -> Node:
        """Return the node of a mapping, which has one entry with a keyword or skill, and sibling entries."""
        label = self._read_label(mapping)
        entries = [entry for key, entry in mapping.entries.items() if key != "as"]
        # A node is a keyword, or a word that is written like the name of a skill.
        node_entries = [
            entry
            for entry in entries
            if entry.key.text in self._keywords or _SKILL_PATTERN.fullmatch(entry.key.text)
        ]
        siblings = [entry for entry in entries if entry not in node_entries]
        if not node_entries:
            for entry in siblings:
                self._add_keyword_error(entry.key.span, entry.key.text)
            if not siblings:
                message = "a node is missing here: the mapping names no node"
                self.add_error(mapping.span, "missing-node", message)
            return InvalidNode(span=mapping.span)
        node_entry, *surplus_entries = node_entries
        name = node_entry.key.text
        span = node_entry.key.span
        for entry in surplus_entries:
            message = f'"{name}" and "{entry.key.text}" are two nodes in one mapping'
            self.add_error(entry.key.span, "two-nodes", message, "Write a list to run one after the other.")
        if surplus_entries:
            # Errors in surplus nodes are discarded, because the author must correct the mapping first.
            parts = [self.make_silent_parser()._read_entry(mapping, entry, "") for entry in surplus_entries]
            first_part = self._read_entry(mapping, node_entry, "")
            return InvalidNode(span=span, label=label, parts=(first_part, *parts))
        node_class = self._node_classes.get(name)
        sibling_keys = node_class.sibling_keys if node_class else {}
        allowed_keys = ("as", *(grammar.UseKeys.get_keys() if name == grammar.USE_KEYWORD else sibling_keys))
        for entry in siblings:
            key = entry.key.text
            if key not in allowed_keys:
                is_inner_key = node_class is not None and key in node_class.inner_keys
                hint = f"Indent {key}: it is a key below {name}." if is_inner_key else ""
                hint = hint or suggest_choice(key, allowed_keys, f"Keys at the level of {name}")
                message = f'"{key}" is not allowed at the level of "{name}"'
                self.add_error(entry.key.span, "unknown-key", message, hint)
        node = self._read_entry(mapping, node_entry, label)
        label_node = mapping.get("as")
        return node.replace(label_span=label_node.span) if label_node else node

    def _read_entry(self, mapping: YamlMapping, entry: YamlEntry, label: str) -> Node:
        """Return the node of a mapping; `entry` is the entry with the keyword or skill."""
        name = entry.key.text
        if name == grammar.USE_KEYWORD:
            return self._read_use(mapping, entry, label)
        if name == grammar.BEHAVIOUR_KEYWORD:
            return self._read_behaviour(entry, label)
        if name in self._node_classes:
            return self._read_control_node(mapping, entry, label, self._node_classes[name])
        params = self._skills[name].params if name in self._skills else {}
        rules = [param.name for param in params.values() if param.candidate]
        settings = read_settings(entry.value, name, self.findings, next(iter(params), "name"), rules)
        for rule in rules:
            if isinstance(value := settings.get(LocatedName(rule)), Expression):
                settings[LocatedName(rule)] = value.mark_candidate(params[rule].candidate)
        return SkillNode.model_construct(span=entry.key.span, label=label, skill=name, settings=settings)

    def _read_use(self, mapping: YamlMapping, entry: YamlEntry, label: str) -> Node:
        """Return the use of a subtree, or an invalid node if the name of the subtree is no text."""
        arguments = read_settings(mapping.get("with"), "with", self.findings)
        returns = read_settings(mapping.get("returns"), "returns", self.findings)
        if not (isinstance(entry.value, YamlScalar) and isinstance(entry.value.value, str)):
            message = f"use must be the name of a subtree, not {entry.value.description}"
            self.add_error(entry.value.span, "wrong-type", message)
            return InvalidNode(span=entry.key.span)
        return SubtreeNode.model_construct(
            span=entry.value.span, label=label, name=entry.value.text, arguments=arguments, returns=returns
        )

    def _read_behaviour(self, entry: YamlEntry, label: str) -> Node:
        """Return the skill node for a behaviour, or an invalid node if a mission cannot use the behaviour."""
        keyword = entry.key.text
        class_key = grammar.BEHAVIOUR_CLASS
        span = entry.key.span
        settings = read_settings(entry.value, keyword, self.findings, class_key)
        path = settings.pop(LocatedName(class_key), None)
        if isinstance(path, Constant) and isinstance(path.value, str):
            try:
                skill = load_behaviour(path.value)
                name = skill.__name__
                if {**self._skills, **self.behaviours}.get(name, skill) is not skill:
                    advice = "register this class as a skill under another name"
                    raise InputError(f'there is another skill "{name}"; {advice}')
            except InputError as error:
                self.add_error(path.span, "unknown-behaviour", str(error))
                return InvalidNode(span=span, label=label)
            self.behaviours[name] = skill
            return SkillNode.model_construct(span=span, label=label, skill=name, settings=settings)
        if isinstance(path, Constant | Reference):
            example = "for example py_trees.behaviours:TickCounter"
            message = f"{keyword}.{class_key} must be an import path, {example}"
            self.add_error(path.span, "wrong-type", message)
        elif path is None and (is_empty(entry.value) or isinstance(entry.value, YamlMapping)):
            self.add_error(span, "missing-key", f'{keyword} needs the key "{class_key}"')
        return InvalidNode(span=span, label=label)

    def _read_label(self, mapping: YamlMapping) -> str:
        value = mapping.get("as")
        if value is None:
            return ""
        description = value.description
        if isinstance(value, YamlScalar):
            description = f'"{value.text}"'
            if isinstance(value.value, str) and re.fullmatch(grammar.LABEL_EXPRESSION, value.text):
                return value.text
        self.add_error(value.span, "bad-label", f"a label must be a lower-case word, not {description}")
        return ""

    def _add_keyword_error(self, span: Span, word: str) -> None:
        """Add an error for a word that is no keyword and no skill."""
        skills_by_lower_case = {name.lower(): name for name in self._skills}
        skill = skills_by_lower_case.get(word.replace("_", "").replace(" ", "").lower())
        hints = dict(grammar.KEYWORD_HINTS)
        for name, node_class in self._node_classes.items():
            keys = node_class.sibling_keys
            hints |= {key: f"Write {key} at the level of {name}, not below {name}." for key in keys}
        hint = hints.get(word) or (f'Did you mean the skill "{skill}"?' if skill else "")
        if not hint:
            keywords = suggest_choice(word, self._keywords, "Control nodes")
            hint = f"{keywords} A subtree is written as use: NAME."
        self.add_error(span, "unknown-node", f'there is no control node "{word}"', hint)

    def _read_control_node(
        self, mapping: YamlMapping, entry: YamlEntry, label: str, node_class: type[ControlNode]
    ) -> Node:
        """Return the control node of a mapping, or an invalid node if the children or a variable are invalid.

        `entry` is the entry of the mapping with the keyword; the other entries have sibling keys.
        """
        keyword = entry.key.text
        span = entry.key.span
        sibling_keys = node_class.sibling_keys
        siblings = {key: sibling for key, sibling in mapping.entries.items() if key in sibling_keys}
        values = {
            **self._read_inner_keys(keyword, span, entry.value, node_class),
            **self._read_keys(keyword, span, replace(mapping, entries=siblings), sibling_keys),
        }
        any_of = node_class.any_of
        inner_keys = entry.value.entries if isinstance(entry.value, YamlMapping) else ()
        # `MappingReader` reports a value that is not a mapping although it must be one.
        is_form_valid = isinstance(entry.value, YamlMapping) or node_class.shorthand_key is not None
        if any_of and is_form_valid and not {*mapping.entries, *inner_keys} & {*any_of}:
            level = f" at the level of {keyword}" if set(any_of) <= set(sibling_keys) else ""
            alternatives = " or ".join(f'"{name}"' for name in any_of)
            self.add_error(span, "missing-key", f"{keyword} needs {alternatives}{level}")
        missing = [key for name, key in node_class.keys.items() if key.is_required and name not in values]
        if any(key.value_type in (Children, VariableName) for key in missing):
            children = [node for value in values.values() for node in list_nodes(value)]
            return InvalidNode(span=span, label=label, parts=tuple(children))
        return _make_owner(node_class, values, span=span, label=label)

    def _read_inner_keys(
        self, name: str, span: Span, yaml_node: YamlNode, owner: type[KeyOwner]
    ) -> dict[str, KeyValue]:
        """Return the values of the keys of `owner`; `yaml_node` is below the keyword `name`."""
        shorthand_key = owner.shorthand_key
        inner_keys = owner.inner_keys
        is_list_required = shorthand_key is not None and shorthand_key.value_type == Children
        # If the owner has inner keys, a mapping contains these keys, and is no node in shorthand form. A
        # scalar in place of a list is treated like a mapping: `MappingReader` reports it and lists the keys.
        is_scalar_for_list = is_list_required and isinstance(yaml_node, YamlScalar)
        reads_inner_keys = isinstance(yaml_node, YamlMapping) or is_scalar_for_list
        if shorthand_key is not None and not (reads_inner_keys and inner_keys):
            key_node = YamlScalar(span, name, shorthand_key.name)
            yaml_node = YamlMapping(span, {shorthand_key.name: YamlEntry(key_node, yaml_node)})
            inner_keys = {shorthand_key.name: shorthand_key}
        return self._read_keys(name, span, yaml_node, inner_keys)

    def _read_keys(
        self, name: str, span: Span, yaml_node: YamlNode, keys: Mapping[str, Key]
    ) -> dict[str, KeyValue]:
        """Return the valid values of `keys` in a mapping.

        `InvalidNode` or `InvalidValue` stands for a required node or constant that the mapping lacks.
        """
        fields = {key.name: key.field for key in keys.values()}
        reader = MappingReader(name, span, yaml_node, fields, self.findings)
        values: dict[str, KeyValue] = {}
        for key in keys.values():
            if (value_node := reader.get(key.name)) is not None:
                value = self._read_value(reader, key, value_node)
                values |= {} if value is None else {key.name: value}
            elif key.is_required and key.value_type == Child:
                values[key.name] = InvalidNode(span=span)
            elif key.is_required and key.is_plain:
                values[key.name] = InvalidValue(span)
        return values

    def _read_value(self, reader: MappingReader, key: Key, yaml_node: YamlNode) -> KeyValue | None:
        """Return the value of a key, or None after an error and for an omitted optional child."""
        span = reader.get_key_span(key.name)
        if key.value_type == Expression:
            return self._read_expression(key, yaml_node)
        if key.is_plain:
            return read_value(yaml_node, self.findings)
        if key.value_type == Child:
            is_omitted = is_empty(yaml_node) and key.shorthand and not key.is_required
            return None if is_omitted else self.read_node(yaml_node, span)
        if key.value_type == Children:
            nodes = self.read_nodes(yaml_node, reader.owner)
            if key.max_count is None or len(nodes) <= key.max_count:
                return nodes or None
            message = f"{reader.owner} has {len(nodes)} branches, but may have at most {key.max_count}"
            self.add_error(reader.span, "too-large", message)
            return None
        if key.value_type == VariableName:
            return self._read_variable(reader, key.name)
        section = key.section
        if section is None:
            accepts_expressions = Expression in list_member_types(key.value_type)
            return reader.read_reasons(key.name, accepts_expressions=accepts_expressions)
        if key.value_type is section:
            return self._read_section(key.name, section, yaml_node, span)
        return tuple(self._read_sections(key.name, section, yaml_node))

    def _read_expression(self, key: Key, yaml_node: YamlNode) -> Value:
        """Return the expression of a key, or of a text with expressions in braces."""
        if not isinstance(yaml_node, YamlScalar) or yaml_node.value is None:
            message = f"{key.name} must be an expression, not {yaml_node.description}"
            self.add_error(yaml_node.span, "wrong-type", message)
            return InvalidValue(yaml_node.span)
        read = read_template if key.is_template else read_expression
        return read(yaml_node.text, yaml_node.span, self.findings)

    def _read_variable(self, reader: MappingReader, key: str) -> VariableName | None:
        """Return the output variable of a key; for `$name`, add an error and return the variable `name`."""
        text = reader.read_text(key)
        span = reader.get_value_span(key)
        if NAME_PATTERN.fullmatch(text):
            return VariableName(text, span=span)
        hint = f"Write the name without $, for example {key}: target; $target is then the value."
        self.add_error(span, "bad-name", f'"{text}" is no valid name of a variable', hint)
        name = text.removeprefix("$")
        return VariableName(name, span=span) if NAME_PATTERN.fullmatch(name) else None

    def _read_section(
        self, key: str, section: type[KeySection], yaml_node: YamlNode, span: Span
    ) -> KeySection:
        """Return the section below a key."""
        values = self._read_inner_keys(key, span, yaml_node, section)
        if section.any_of and isinstance(yaml_node, YamlMapping) and not yaml_node.entries:
            alternatives = " or ".join(f'"{name}"' for name in section.any_of)
            self.add_error(span, "missing-key", f"{key} needs {alternatives}")
        return _make_owner(section, values, span=span)

    def _read_sections(
        self, key: str, section: type[KeySection], yaml_node: YamlNode
    ) -> Iterable[KeySection]:
        """Yield the sections of a list, or a single section."""
        kind = "mapping with " + " and ".join(f'"{name}"' for name in section.keys)
        if not isinstance(yaml_node, YamlSequence | YamlMapping):
            message = f"{key} must be a {kind}, or a list of such mappings, not {yaml_node.description}"
            self.add_error(yaml_node.span, "wrong-type", message)
            return
        if isinstance(yaml_node, YamlSequence) and not yaml_node.items:
            self.add_error(yaml_node.span, "empty-list", f"{key} needs at least one {kind}")
        for item in yaml_node.items if isinstance(yaml_node, YamlSequence) else (yaml_node,):
            yield self._read_section(key, section, item, item.span)


def _make_owner(owner: type[OwnerT], values: Mapping[str, KeyValue], **attributes: object) -> OwnerT:
    """Return a control node or a section with the values of its keys."""
    settings: dict[str, Value] = {}
    for name, value in values.items():
        if isinstance(value, Value):
            settings[name] = value
        else:
            attributes[owner.keys[name].attribute] = value
    for key in owner.keys.values():
        if key.is_required and not key.is_plain:
            attributes.setdefault(key.attribute, ())
    return owner.make(settings, **attributes)
