"""What `executive check` says of one mission."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from executive.mission.findings import Finding
from executive.mission.flow.endings import Ending


def verdict(mission: str, findings: Iterable[Finding], endings: Sequence[Ending]) -> str:
    """Return the warnings of a mission that can be run, and which failures can still end it."""
    lines = [*map(str, findings), f"{mission}: ok"]
    if endings:
        lines.append("  nothing deals with these failures; each would end the mission:")
        lines += [f"    {line}" for line in _places(endings)]
    return "\n".join(lines)


def _places(endings: Sequence[Ending]) -> list[str]:
    """Return a line per node in the file; a subtree used twice is one place."""
    places: dict[tuple[str, str, int], list[Ending]] = {}
    for ending in endings:
        places.setdefault((ending.source, ending.path, ending.line), []).append(ending)
    names = {
        place: f"{place[0]}: {', '.join(dict.fromkeys(ending.reason for ending in found))}"
        for place, found in places.items()
    }
    width = max(map(len, names.values()))
    return [f"{name:{width}}  {place[1]}:{place[2]}" for place, name in names.items()]
