"""Whether everything that packages register can be loaded."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from executive.cli.doctor.finding import Finding
from executive.errors import InputError
from executive.project import Project, project_here


def registered(
    count: Callable[[], dict[str, int]] | None = None, project: Callable[[], Project | None] = project_here
) -> Iterator[Finding]:
    """Yield how many skills, kinds of cells and kinds of detectors there are, the working directory's too."""
    try:
        told = ", ".join(f"{number} {what}" for what, number in (count or loaded)().items())
        here = project()
    except InputError as error:
        yield Finding("problem", "registered", str(error))
        return
    yield Finding("ok", "registered", told + (f"; {here.file} counts" if here is not None else ""))


def loaded() -> dict[str, int]:
    """Load everything that is registered, and return how much of each sort there is.

    Raises:
        InputError: Something cannot be loaded.
    """
    from executive.discovery import discover
    from executive.entry_points import registered
    from executive.runtime import cells
    from executive.vision.detectors import registry

    kinds = registered(cells.GROUP, "kind of cell"), registry.installed()
    for entries in kinds:
        for entry in entries.values():
            entry.load()
    return {"skills": len(discover()), "kinds of cells": len(kinds[0]), "kinds of detectors": len(kinds[1])}
