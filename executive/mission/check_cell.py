"""Checks of the names that a mission takes from its cell."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from executive.cell_config import CellConfig
from executive.mission.case import Case
from executive.mission.findings import Finding, alternatives, error
from executive.mission.wiring import literals


def routes(case: Case) -> Iterator[Finding]:
    """Find every route of an unknown class or to an unknown bin."""
    if case.cell is None:
        return
    for route in case.mission.routes:
        if route.label not in case.cell.objects:
            hint = alternatives(route.label, case.cell.objects, "Its classes")
            yield error(route.key, "unknown-class", f'the cell knows no class "{route.label}"', hint)
        if route.bin not in case.cell.bins:
            hint = alternatives(route.bin, case.cell.bins, "Its bins")
            yield error(route.mark, "unknown-bin", f'the cell has no bin "{route.bin}"', hint)


def names(case: Case) -> Iterator[Finding]:
    """Find every param that names something the cell does not have."""
    if case.cell is None:
        return
    known = _known(case.cell)
    for node, skill in case.known_skills():
        for name, value in literals(node):
            param = skill.params.get(name)
            if param is None or param.refers not in known or value.value == param.default:
                continue
            words = [*known[param.refers], *(param.choices or ())]
            for word in value.value if isinstance(value.value, list) else [value.value]:
                if isinstance(word, str) and word not in words:
                    message = f'the cell has no {param.refers} "{word}" for {node.skill}.{name}'
                    hint = alternatives(word, words, f"{node.skill}.{name} takes")
                    yield error(value.mark, f"unknown-{param.refers}", message, hint)


def _known(cell: CellConfig) -> Mapping[str, list[str]]:
    """Return the names of everything a param can refer to."""
    return {
        "bin": list(cell.bins),
        "detector": list(cell.detectors),
        "pose": list(cell.arm.poses_deg),
        "class": list(cell.objects),
    }
