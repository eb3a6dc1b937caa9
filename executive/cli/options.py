"""Arguments and options that several commands share."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import click


def _parse_overrides(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, str]:
    """Return the values of overrides `KEY=VALUE`, by key; refuse a key that is given twice."""
    overrides: dict[str, str] = {}
    for value in values:
        key, equals, text = value.partition("=")
        if not key or not equals:
            message = f'"{value}" is no override; write it as KEY=VALUE, for instance attempts=5'
            raise click.BadParameter(message, ctx, param)
        if key in overrides:
            raise click.BadParameter(f'"{key}" is set twice', ctx, param)
        overrides[key] = text
    return overrides


class PathType(click.Path):
    """Path that is neither empty (`Path("")` is the working directory) nor a link without a target."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path, or end the command with an error."""
        if str(value) == "":
            self.fail("the path is empty", param, ctx)
        if os.path.islink(value) and not os.path.exists(value):
            self.fail(f"{value} is a link that leads to no file", param, ctx)
        return super().convert(value, param, ctx)


FILE = PathType(path_type=Path, dir_okay=False)
FOLDER = PathType(path_type=Path, file_okay=False)
COUNT = click.IntRange(min=1)
MAX_SEED = 2**32 - 1
"""Largest seed: a number of 32 bits, which every random number generator accepts."""
MISSION = click.argument("mission", metavar="MISSION")


def refuse(*conflicts: tuple[object, str]) -> None:
    """Raise the first error whose condition is true.

    Args:
        conflicts: Condition and message of each error.

    Raises:
        UsageError: A condition is true.
    """
    for is_wrong, message in conflicts:
        if is_wrong:
            raise click.UsageError(message)


overrides_option = click.option(
    "--set", "overrides", metavar="KEY=VALUE", multiple=True, callback=_parse_overrides,
    help="Set a param, or with cell.KEY.KEY a key of the cell; repeatable.",
)  # fmt: skip
runs_option = click.option("--runs", type=FOLDER, default=Path("runs"), help="Folder of the run directories.")
json_option = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")
seed_option = click.option(
    "--seed", type=click.IntRange(0, MAX_SEED), default=0, help="Seed of all random numbers."
)
scene_option = click.option(
    "--scene", type=FILE, metavar="FILE",
    help="Change the simulated world without the executive's knowledge: light, table, objects, camera.",
)  # fmt: skip
workers_option = click.option("--workers", type=COUNT, default=2, help="Number of concurrent runs.")
oracle_option = click.option(
    "--oracle", is_flag=True,
    help="Take detections from the true world: a simulated sort then takes about two seconds.",
)  # fmt: skip
