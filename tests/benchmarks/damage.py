"""Random damage to the files of a run directory, decided by a seed."""

from __future__ import annotations

import json
import math
import os
import random
import shutil
from pathlib import Path
from typing import Any

ODD_VALUES = (
    None, True, -1, 0, 10**12, -0.5, 1e308, math.inf, "", "x", "\x1b[31m", "x" * 500, [], [1], ["x"], {},
    {"a": 1},
)  # fmt: skip
"""Values that replace a value of an event."""
NUMBERS = (-1, 0, 1, 7, 10**5, 10**12, 0.5, -3.7, 1e9)
"""Numbers that replace a number of an event."""
BLOCK = 4096
"""Size of a block of a disk [bytes]."""
OTHER_FILES = ("tree.json", "cell.yaml", "mission.yaml", "params.yaml", "result.json", "world.log", "frames")
"""Files of a run directory besides its journal."""


def copy_run(source: Path, target: Path) -> Path:
    """Copy a run directory, its pictures as links, and return the copy."""
    shutil.copytree(source, target, ignore=shutil.ignore_patterns("frames"))
    if (source / "frames").is_dir():
        shutil.copytree(source / "frames", target / "frames", copy_function=os.link)
    return target


def damage_run(seed: int, path: Path) -> str:
    """Damage the journal of a run or, in one case of five, another file; return the damage in words."""
    rng = random.Random(seed)
    if rng.random() < 0.8:
        journal = path / "journal.jsonl"
        content, damage = damage_journal(rng, journal.read_bytes())
        journal.write_bytes(content)
        return damage
    return _damage_file(rng, path / rng.choice(OTHER_FILES))


def damage_journal(rng: random.Random, content: bytes) -> tuple[bytes, str]:
    """Return a journal with one damage, and the damage in words."""
    lines = content.splitlines(keepends=True)
    number, other = rng.randrange(len(lines)), rng.randrange(len(lines))
    kind = rng.choice(("value", "value", "value", "number", "number", "key", "line", "bytes", "end"))
    if kind == "bytes":
        return _damage_bytes(rng, content), "bytes"
    if kind == "end":
        return content[: rng.randrange(len(content))] + rng.choice((b"", bytes(BLOCK))), "end"
    where = f"{kind} in line {number + 1}"
    if kind == "line":
        lines[number] = rng.choice(
            (b"", lines[number] * 2, lines[other], b"\n", b"null\n", b"[" * 9999, lines[number][:-9] + b"\n")
        )
        return b"".join(lines), where
    entry = json.loads(lines[number])
    if kind == "key":
        _damage_key(rng, entry)
    else:
        _replace_value(rng, entry, NUMBERS if kind == "number" else ODD_VALUES)
    lines[number] = json.dumps(entry).encode() + b"\n"
    return b"".join(lines), where


def _damage_key(rng: random.Random, entry: dict[str, Any]) -> None:
    """Remove, rename or add a key."""
    key = rng.choice(list(entry))
    value = entry[key] if rng.random() < 0.3 else entry.pop(key)
    if rng.random() < 0.6:
        entry[rng.choice((key + "s", "x", key.upper()))] = value


def _replace_value(rng: random.Random, entry: Any, values: tuple[Any, ...]) -> None:
    """Replace a value at a random depth."""
    is_number = values is NUMBERS
    places = [
        (holder, key)
        for holder, key, value in _walk(entry)
        if not is_number or (isinstance(value, int | float) and not isinstance(value, bool))
    ]
    holder, key = rng.choice(places)
    holder[key] = rng.choice(values)


def _walk(value: Any) -> list[tuple[Any, Any, Any]]:
    """Return the holder, the key and the value of each value inside of `value`."""
    pairs = list(
        value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    )
    return [(value, key, inner) for key, inner in pairs] + [
        found for _, inner in pairs for found in _walk(inner)
    ]


def _damage_file(rng: random.Random, file: Path) -> str:
    """Remove a file, or change its bytes or its end; of a folder, one of its files."""
    if file.is_dir():
        file = rng.choice([file, *sorted(file.iterdir())])
    if file.is_dir() or not file.exists() or rng.random() < 0.15:
        shutil.rmtree(file, ignore_errors=True)
        file.unlink(missing_ok=True)
        return f"no {file.name}"
    content = file.read_bytes()
    changed = (
        _damage_bytes(rng, content) if rng.random() < 0.7 else content[: rng.randrange(len(content) + 1)]
    )
    # A picture is a link to the file of another copy of the run.
    file.unlink()
    file.write_bytes(changed)
    return f"bytes in {file.name}"


def _damage_bytes(rng: random.Random, content: bytes) -> bytes:
    """Return content with some other bytes, with a part missing or repeated, or with a block of zeros."""
    start = rng.randrange(max(len(content), 1))
    part = content[start : start + rng.choice((1, 1, 20, BLOCK))]
    changed = rng.choice(
        (rng.randbytes(len(part)), b"", part * 2, bytes(len(part)), bytes(byte ^ 1 for byte in part))
    )
    return content[:start] + changed + content[start + len(part) :]
