"""What `executive check` says of one mission."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from executive.mission.endings import Ending
from executive.mission.findings import Finding


def verdict(mission: str, findings: Iterable[Finding], endings: Sequence[Ending]) -> str:
    """Return the warnings of a mission that can be run, and which failures can still end it."""
    lines = [*map(str, findings), f"{mission}: ok"]
    if endings:
        lines.append("  nothing deals with these failures; each would end the mission:")
        lines += [f"    {line}" for line in _places(endings)]
    return "\n".join(lines)


def _places(endings: Sequence[Ending]) -> list[str]:
    """Return a line per failure and place in the file; a subtree used twice is one place."""
    groups: dict[tuple[str, str, int], list[str]] = {}
    for ending in endings:
        groups.setdefault((ending.reason, ending.path, ending.line), []).append(ending.node)
    width = max(len(reason) for reason, _, _ in groups)
    lines = []
    for (reason, path, line), nodes in groups.items():
        more = f" and {len(nodes) - 1} more of its uses" if len(nodes) > 1 else ""
        lines.append(f"{reason:{width}}  {path}:{line}  {nodes[0]}{more}")
    return lines
