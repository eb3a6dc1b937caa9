"""Mutated mission files: each is refused with findings, or runs without a fault."""

from __future__ import annotations

import random
import re
import signal
from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import pytest
import yaml

from executive.behaviours import load_skills
from executive.errors import InputError
from executive.mission.load import load_mission
from executive.run.assembly import RunOptions, assemble
from executive.station.check import load_checker
from executive.testing.fake_cell import FakeCell
from executive.text.findings import MissionError

MISSIONS = Path(__file__).parents[2] / "missions"
BASES = sorted((Path(__file__).parent / "bases").glob("*.yaml"))
MAX_STEPS = 4000
"""Number of control steps after which a run is halted."""
ODD_VALUES: tuple[Any, ...] = (
    None, True, 0, -1, 1e-9, 10**40, float("nan"), float("inf"), "", "$", "$x", "$$x", "$a.b", "auto",
    "Detect", "Grasp.missed", "\n", "\ud800", "x" * 300, [], [[]], [None], {}, {"do": None}, "succeed",
)  # fmt: skip
ODD_TEXTS = (
    "&a ", "*a", "!!int ", "<<: ", "\t", "\r", "\0", "\ufeff", "\u2028", "---\n", "{", "]", '"',
    "'", "|", "- ", "? ", ": ", "# ", "@", "\\", "0x" + "f" * 290, "1e999", ".nan", "~", "\x85", '"\\ud800"',
)  # fmt: skip


class HaltedCell(FakeCell):
    """A fake cell that halts its run as Ctrl-C does."""

    def advance(self) -> None:
        super().advance()
        if self.tick_count == MAX_STEPS:
            signal.raise_signal(signal.SIGINT)


def list_places(data: Any) -> Iterator[tuple[Any, Any]]:
    """Yield each list and mapping below `data` with each of its indices or keys."""
    for key in list(data) if isinstance(data, dict) else range(len(data)) if isinstance(data, list) else ():
        yield data, key
        yield from list_places(data[key])


def mutate_data(dice: random.Random, text: str, pool: list[Any]) -> str:
    """Return a text in which a value was deleted, replaced, wrapped or put elsewhere, or a key renamed."""
    data = yaml.safe_load(text)
    container, key = dice.choice(list(list_places(data)))
    value = container[key]
    change = dice.choice(("delete", "graft", "graft", "graft", "retype", "wrap", "swap", "rename"))
    if change == "delete":
        del container[key]
    elif change == "rename" and isinstance(container, dict):
        container[dice.choice(("do", "tree", "on", f"{key}x"))] = container.pop(key)
    elif change == "swap":
        other, other_key = dice.choice(list(list_places(data)))
        container[key] = deepcopy(other[other_key])
        other[other_key] = deepcopy(value)
    else:
        wrapped = dice.choice(([value], {"succeed": value}, {"retry": {"attempts": 2, "do": value}}))
        replacements = {"retype": dice.choice(ODD_VALUES), "wrap": wrapped}
        container[key] = deepcopy(replacements.get(change, dice.choice(pool)))
    return yaml.safe_dump(data, sort_keys=False, width=200)


def mutate_text(dice: random.Random, text: str) -> str:
    """Return a text with a character, a word or a line changed, or cut off somewhere."""
    at = dice.randrange(len(text) + 1)
    lines = text.splitlines(keepends=True)
    line = dice.randrange(len(lines))
    word = dice.choice(list(re.finditer(r"[\w.$]+", text)))
    odd = dice.choice(ODD_TEXTS)
    other_line = dice.choice([*lines, "  " + lines[line], lines[line].lstrip(" ")])
    return dice.choice((
        text[:at] + odd + text[at:],
        text[:at],
        text[: word.start()] + odd + text[word.end() :],
        "".join([*lines[:line], other_line, *lines[line + 1 :]]),
    ))  # fmt: skip


@pytest.mark.slow
@pytest.mark.usefixtures("shared_cells")
def test_mutants_are_refused_or_run_without_a_fault(tmp_path: Path) -> None:
    texts = [file.read_text() for file in [*sorted(MISSIONS.glob("*.yaml")), *BASES]]
    pool = [container[key] for text in texts for container, key in list_places(yaml.safe_load(text))]
    skills = load_skills()
    run_count = 0
    for seed in range(150):
        dice = random.Random(seed)
        text = dice.choice(texts)
        text = mutate_text(dice, text) if dice.random() < 0.2 else mutate_data(dice, text, pool)
        mission = tmp_path / f"{seed}.yaml"
        mission.write_bytes(text.encode(errors="surrogatepass"))
        try:
            overrides = {"cell.kind": "fake", "cell.table.objects": "[1, 3]"}
            loaded = load_mission(mission, skills, overrides, load_checker)
        except MissionError as error:
            assert any(finding.severity == "error" for finding in error.findings), seed
            assert str(error).encode(), seed
            continue
        except InputError:
            continue
        run = assemble(loaded, RunOptions(seed, [*loaded.routes, "rescan"], make_cell=HaltedCell), [])
        outcome = run.execute()
        run.close()
        assert outcome.status != "FAULT", f"seed {seed}: {outcome.message}"
        run_count += 1
    assert run_count >= 10, "few mutants pass the check"
