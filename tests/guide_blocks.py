"""The guides as the tests read them: fenced blocks, and the files that they show.

The guides in `missions/` mark by comments above a block what a reader sees anyway:

* `<!-- complete: NAME -->`: a part of a mission; what it does not show is as in the mission NAME.
* `<!-- mistake -->`: `executive check` finds something in it.

Its mission `hello` is the file `hello.yaml`, its library `mine` `library/mine.yaml`, its cell `trays`
`cells/trays.yaml`, its scene `dusk` `scenes/dusk.yaml`. A ```text block holds what is printed by the
command in the ```console block before it, or by `executive check` of the mistake before it.
"""

from __future__ import annotations

import re
import shlex
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import yaml

ROOT = Path(__file__).parent.parent
TUTORIAL = "missions/README.md"
MISSION_GUIDES = (
    TUTORIAL, "missions/expressions.md", "missions/running.md", "missions/editor.md", "missions/detectors.md",
    "missions/scenes.md", "missions/arms.md", "missions/tools.md",
)  # fmt: skip
GUIDES = ("README.md", *MISSION_GUIDES, "skills/README.md")

_FENCED = re.compile(r"((?:^<!-- [^\n]* -->\n)*)^```(\w+)\n(.*?)^```$", re.MULTILINE | re.DOTALL)
_KEY = re.compile(r"^(\w+:)(.*?)(?=^\w|\Z)", re.MULTILINE | re.DOTALL)


@dataclass(frozen=True)
class Block:
    """A fenced block of a guide; `marks` are the comments above it, `where` is guide and line."""

    where: str
    language: str
    marks: tuple[str, ...]
    text: str

    @property
    def is_mistake(self) -> bool:
        """Whether it shows a mistake."""
        return "mistake" in self.marks


@dataclass(frozen=True)
class File:
    """A file that a guide to missions shows, with the keys put in that the block leaves out."""

    name: str
    block: Block
    text: str


def blocks(guide: str) -> Iterator[Block]:
    """Yield every fenced block of a guide."""
    text = read(guide)
    for match in _FENCED.finditer(text):
        line = text.count("\n", 0, match.start(2)) + 1
        yield Block(f"{guide}:{line}", match[2], tuple(re.findall(r"<!-- (.*) -->", match[1])), match[3])


def shown(language: str) -> list[Block]:
    """Return every block of a language in all guides."""
    return [block for guide in GUIDES for block in blocks(guide) if block.language == language]


def files() -> dict[str, File]:
    """Return every file that the guides to missions show, by its name."""
    found: dict[str, File] = {}
    for block in (block for guide in MISSION_GUIDES for block in blocks(guide)):
        if block.language == "yaml":
            text = block.text
            for mark in block.marks:
                if mark.startswith("complete: "):
                    text = _completed(text, found[f"{mark.removeprefix('complete: ')}.yaml"].text)
            name = _file_name(text)
            assert name not in found, f"{block.where} shows {name} once more"
            found[name] = File(name, block, text)
    return found


def transcripts() -> Iterator[tuple[str, list[str], str]]:
    """Yield where it stands, the words after `executive`, and what is printed, of every command shown."""
    names = {file.block.where: name for name, file in files().items()}
    for guide in MISSION_GUIDES:
        before = None
        for block in blocks(guide):
            if before is not None and before.language == "console":
                prompt, program, *words = shlex.split(before.text)
                assert (prompt, program, block.language) == ("$", "executive", "text"), before.where
                yield before.where, words, block.text
            elif before is not None and before.is_mistake:
                assert block.language == "text", f"{before.where}: what check says is missing"
                yield before.where, ["check", names[before.where]], block.text
            before = block


def read(guide: str) -> str:
    """Return the text of a guide."""
    return (ROOT / guide).read_text(encoding="utf-8")


def _completed(part: str, whole: str) -> str:
    """Return a part of a mission with the keys of the whole one that it does not show, in its order."""
    keys = {**dict(_KEY.findall(whole)), **dict(_KEY.findall(part))}
    return "".join(key + text for key, text in keys.items())


def _file_name(text: str) -> str:
    folders = {
        "mission": "",
        "scene": "scenes/",
        "library": "library/",
        "cell": "cells/",
        "arm": "cells/arms/",
    }
    content = yaml.safe_load(text)
    key = next(key for key in folders if key in content)
    return f"{folders[key]}{content[key]}.yaml"
