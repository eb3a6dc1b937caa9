"""Command line and printed output of all benchmarks.

A benchmark returns its figures as one plain dictionary. Values are printed one a line, lists of dictionaries
as tables, and lists of sentences with their counts. The exit code is 1 if the list `problems` is not empty.
"""

from __future__ import annotations

import inspect
import json
import sys
from collections import Counter
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, TypeVar

import click
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.progress import track
from rich.table import Table

from executive.campaign.evaluation import load_cells
from executive.campaign.jobs import MissionUnderTest, load_mission_under_test
from executive.cell.json_values import to_json
from executive.cli.shared import (
    cell_option,
    json_option,
    keep_stdout_clean,
    mission_argument,
    oracle_option,
    overrides_option,
    print_json,
    runs_option,
    seed_option,
    workers_option,
)
from executive.errors import ExecutiveError
from executive.events import TimedEvent
from executive.record.recorded_run import RecordOptions, record_run
from executive.run.assembly import RunOptions
from executive.run.run import Run

Figures = dict[str, Any]
"""Figures of a benchmark by name; a name ends with the unit."""
Option = Callable[[Callable[..., Any]], Callable[..., Any]]
"""Decorator of click that adds an argument or an option to a command."""
TABLE_WIDTH = 160
"""Width of the widest table [characters]."""
T = TypeVar("T")

SHARED_OPTIONS: dict[str, tuple[Option, ...]] = {
    "subject": (mission_argument, cell_option, oracle_option, seed_option, overrides_option),
    "cell": (click.argument("cell", default="overhead"),),
    "folders": (
        click.argument("folders", nargs=-1, required=True, type=click.Path(exists=True, path_type=Path)),
    ),
    "seed": (seed_option,),
    "runs_folder": (runs_option,),
    "workers": (workers_option,),
}
"""Arguments and options that several benchmarks have, by the parameter that receives their values."""
OPTION_TYPES: dict[str, Any] = {
    "int": click.IntRange(min=0),
    "float": click.FloatRange(min=0),
    "Path": click.Path(path_type=Path, dir_okay=False),
}
"""Types of the options that only one benchmark has, by the annotation of the parameter."""


class SilentView:
    """View of a run that shows nothing; subclasses observe the events."""

    def open(self, run: Run) -> None:
        """Do nothing."""

    def __call__(self, timed: TimedEvent) -> None:
        """Ignore an event."""

    def close(self) -> None:
        """Do nothing."""

    def show_message(self, message: str) -> None:
        """Ignore a message."""


def run_command(measure: Callable[..., Figures]) -> None:
    """Parse the command line, print the figures that `measure` returns for it, and exit.

    Each parameter of `measure` is an option; its docstring is the help.
    """

    def command(as_json: bool, **values: Any) -> None:
        if "mission" in values:
            names = ("mission", "overrides", "oracle", "seed", "cell")
            values["subject"] = load_mission_under_test(*[values.pop(name) for name in names])
        elif "cell" in values:
            (values["cell"],) = load_cells((values["cell"],)).values()
        with keep_stdout_clean():
            figures = measure(**values)
        if as_json:
            print_json(figures)
        else:
            print_figures(figures)
        sys.exit(int(bool(figures.get("problems"))))

    configured: Any = json_option(command)
    for name, parameter in reversed(inspect.signature(measure).parameters.items()):
        for option in reversed(SHARED_OPTIONS.get(name) or (_make_option(parameter),)):
            configured = option(configured)
    try:
        click.command(help=measure.__doc__)(configured)()
    except ExecutiveError as error:
        click.echo(str(error), err=True)
        sys.exit(error.exit_code)


def _make_option(parameter: inspect.Parameter) -> Option:
    """Return the option for a parameter, whose annotation is a text."""
    name = "--" + parameter.name.replace("_", "-")
    kind = parameter.annotation.removesuffix(" | None")
    if kind == "bool":
        return click.option(name, is_flag=True)
    return click.option(name, type=OPTION_TYPES.get(kind), default=parameter.default, show_default=True)


def record_subject(subject: MissionUnderTest, seed: int, runs: Path) -> tuple[Figures, str]:
    """Run a mission to its end, recorded below `runs`; return its result and, if it failed, a sentence."""
    options = RunOptions(seed, subject.requests, make_cell=subject.make_cell)
    result = record_run(subject.loaded, options, runs, RecordOptions(saves_pictures=False))
    if result.status == "HALTED":
        raise KeyboardInterrupt
    if result.status == "SUCCESS" and not result.disagreement:
        return to_json(result), ""
    return to_json(result), (
        f"seed {seed} ended with {result.status} {result.reason}; the ledger says {result.items}, "
        f"the audit {result.audit}"
    )


def describe(subject: MissionUnderTest) -> Figures:
    """Return the figures that name a mission and its cell."""
    return {"mission": subject.name, "cell": subject.cell_description, "seed": subject.seed}


def show_progress(items: Iterable[T], description: str) -> Iterable[T]:
    """Yield `items`, with a progress bar if stderr is a terminal."""
    console = Console(stderr=True)
    return track(items, description, console=console, disable=not console.is_interactive)


def write_json(path: Path, figures: Figures) -> None:
    """Write figures to a JSON file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(figures, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def print_figures(figures: Figures) -> None:
    """Print figures on standard output."""
    console = Console(highlight=False, markup=False, soft_wrap=True)
    console.width = max(console.width, TABLE_WIDTH)
    for name, value in figures.items():
        if not isinstance(value, list):
            console.print(f"{name:24} {_format(value)}")
        elif value and isinstance(value[0], dict):
            table = Table(title=name, box=SIMPLE_HEAD, title_justify="left")
            for key in value[0]:
                table.add_column(key, justify="left" if isinstance(value[0][key], str) else "right")
            for row in value:
                table.add_row(*map(_format, row.values()))
            console.print(table)
        else:
            console.print(f"{name:24} {len(value) or 'none'}")
            for text, count in Counter(map(_format, value)).most_common():
                console.print(f"  {count} x {text}")


def _format(value: Any) -> str:
    """Return a value as text, a number with four digits."""
    if value is None:
        return ""
    if isinstance(value, float):
        return f"{value:.4g}"
    return value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
