"""The skills that there are, whoever's packages register them."""

from __future__ import annotations

from executive.entry_points import registered
from executive.errors import InputError
from executive.skill import Skill

GROUP = "executive.skills"


def discover() -> dict[str, type[Skill]]:
    """Return every skill by name, found through the entry-point group `executive.skills`.

    Raises:
        InputError: Two packages register one name, an entry is no skill or cannot be loaded, or the
            pyproject.toml of the project one works in is wrong.
    """
    found: dict[str, type[Skill]] = {}
    for name, entry in registered(GROUP, "skill").items():
        loaded = entry.load()
        if not (isinstance(loaded, type) and issubclass(loaded, Skill)):
            raise InputError(f'the entry point "{name}" ({entry.value}) is not a Skill subclass')
        found[name] = loaded
    return found
