"""Whether the packages are installed that the project needs, and those that only some commands need."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from executive.cli.doctor.finding import Finding
from executive.runtime.versions import ITSELF, installed, required

EXTRAS = {
    "view": "watch a run in the browser",
    "train": "train a detector of your own",
}
"""What each extra is for."""
FILMS = "av"
"""The package that writes films."""

Version = Callable[[str], str]
"""Returns the version of a package, "" where it is not installed."""
Needed = Callable[[str], tuple[str, ...]]
"""Returns the packages that the project needs, or those that an extra adds."""


def packages(version: Version = installed, needed: Needed = required) -> Iterator[Finding]:
    """Yield a line if everything needed is installed, else one for everything that is missing."""
    if not version(ITSELF):
        yield Finding(
            "problem", "packages", f"{ITSELF} itself is not installed", "run `uv sync` in its folder"
        )
        return
    names = needed("")
    missing = [name for name in names if not version(name)]
    for name in missing:
        yield Finding("problem", "packages", f"{name} is missing", "run `uv sync`")
    if not missing:
        yield Finding("ok", "packages", f"{ITSELF} {version(ITSELF)} and the {len(names)} that it needs")


def extras(version: Version = installed, needed: Needed = required) -> Iterator[Finding]:
    """Yield which extras are installed, and what writes films."""
    for extra, purpose in EXTRAS.items():
        names = needed(extra)
        missing = [name for name in names if not version(name)]
        if missing:
            yield Finding(
                "note", extra, f"not installed: {', '.join(missing)}",
                f"to {purpose}, run `uv sync --extra {extra}`",
            )  # fmt: skip
        else:
            yield Finding("ok", extra, ", ".join(f"{name} {version(name)}" for name in names))
    if film := version(FILMS):
        yield Finding("ok", "film", f"{FILMS} {film} writes films; the program ffmpeg is not needed")
