"""Checks of the names that a mission takes from its cell."""

from __future__ import annotations

from collections.abc import Iterator

from executive.mission.check.case import Case
from executive.mission.findings import Finding, alternatives, error
from executive.mission.model.wiring import literals
from executive.mission.source import Mark
from executive.skill import Param


def routes(case: Case) -> Iterator[Finding]:
    """Find every route of an unknown class or to an unknown bin."""
    if case.cell is None:
        return
    for route in case.mission.routes:
        if route.label not in case.cell.objects:
            hint = alternatives(route.label, case.cell.objects, "Its classes")
            yield error(route.key, "unknown-class", f'the cell knows no class "{route.label}"', hint)
        for bin in route.bins:
            if bin.name not in case.cell.bins:
                hint = alternatives(bin.name, case.cell.bins, "Its bins")
                yield error(bin.mark, "unknown-bin", f'the cell has no bin "{bin.name}"', hint)


def names(case: Case) -> Iterator[Finding]:
    """Find every param and input that names something the cell does not have."""
    if case.cell is None:
        return
    known = case.names
    for node, skill in case.known_skills():
        for name, value in literals(node):
            declared = skill.params.get(name) or skill.ports.get(name)
            if declared is None or declared.refers not in known or value.value == declared.default:
                continue
            choices = declared.choices if isinstance(declared, Param) else None
            words = [*known[declared.refers], *(choices or ())]
            for index, word in enumerate(value.value if isinstance(value.value, list) else [value.value]):
                if isinstance(word, str) and word not in words:
                    message = f'the cell has no {declared.refers} "{word}" for {node.skill}.{name}'
                    hint = case.variable_hint(word) or alternatives(word, words, f"{node.skill}.{name} takes")
                    mark = value.element_mark(index) if isinstance(value.value, list) else value.mark
                    yield error(mark, f"unknown-{declared.refers}", message, hint)


def known_classes(case: Case) -> Iterator[Finding]:
    """Find every class that the mission names and no detector's model knows."""
    models = {name: labels for name, labels in case.labels.items() if labels is not None}
    if len(models) < len(case.labels) or not models or case.cell is None:
        # A detector whose classes are not known may know any.
        return
    for label, mark in _named_classes(case):
        if label in case.cell.objects and not any(label in labels for labels in models.values()):
            said = "; ".join(f"{name}: {', '.join(labels)}" for name, labels in models.items())
            message = f'no detector of the cell can see the class "{label}"'
            yield error(mark, "unseen-class", message, f"Their models know {said}.")


def _named_classes(case: Case) -> Iterator[tuple[str, Mark]]:
    """Yield every class in the routes and in the settings of skills, with its place."""
    yield from ((route.label, route.key) for route in case.mission.routes)
    for node, skill in case.known_skills():
        for name, value in literals(node):
            declared = skill.params.get(name) or skill.ports.get(name)
            if declared is not None and declared.refers == "class" and isinstance(value.value, str):
                yield value.value, value.mark
