"""Options and arguments of several commands."""

from __future__ import annotations

import os
import re
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

import click
from click.core import ParameterSource

from executive.errors import InputError

CommandT = TypeVar("CommandT", bound=Callable[..., Any])
"""Type of a command function."""


def _parse_overrides(ctx: click.Context, param: click.Parameter, values: tuple[str, ...]) -> dict[str, str]:
    """Return the values of options `--set KEY=VALUE` by key, and reject a key that occurs twice."""
    overrides: dict[str, str] = {}
    for value in values:
        key, separator, text = value.partition("=")
        if not key or not separator:
            message = f'"{value}" is not of the form KEY=VALUE, for example attempts=5'
            raise click.BadParameter(message, ctx, param)
        if key in overrides:
            raise click.BadParameter(f'"{key}" is set twice', ctx, param)
        overrides[key] = text
    return overrides


def _parse_variations(
    ctx: click.Context, param: click.Parameter, values: tuple[str, ...]
) -> dict[str, tuple[str, ...]]:
    """Return the values of options `--vary KEY=[VALUE, ...]` by key, as texts for `--set`."""
    import yaml  # The import takes 0.1 s, for which other commands must not wait.

    variations: dict[str, tuple[str, ...]] = {}
    for key, text in _parse_overrides(ctx, param, values).items():
        try:
            nodes = yaml.compose(text, yaml.SafeLoader)
        except yaml.YAMLError:
            nodes = None
        if not isinstance(nodes, yaml.SequenceNode) or not nodes.value:
            message = f'"{key}={text}" is not of the form KEY=[VALUE, ...], for example attempts=[1, 3]'
            raise click.BadParameter(message, ctx, param)
        texts = tuple(text[node.start_mark.index : node.end_mark.index] for node in nodes.value)
        if len(set(texts)) < len(texts):
            raise click.BadParameter(f'"{key}={text}" contains a value twice', ctx, param)
        variations[key] = texts
    return variations


def _parse_seed_range(text: str) -> range:
    """Return the seeds for `FIRST:END` (without END), `FIRST-LAST` (with LAST), or `FIRST`."""
    match = re.fullmatch(r"(\d{1,10})(?:([-:])(\d{1,10}))?", text)
    if match is None:
        raise click.BadParameter(f'"{text}" is not a range of seeds, for example 0:100 or 0-99')
    first = int(match[1])
    last = int(match[3] or match[1]) - (match[2] == ":")
    if last < first:
        end = f"the end {match[3]} is excluded" if match[2] == ":" else f"{last} is less than {first}"
        raise click.BadParameter(f'"{text}" contains no seed: {end}')
    if last > MAX_SEED:
        raise click.BadParameter(f'seed {last} in "{text}" is too large; the maximum is {MAX_SEED}')
    return range(first, last + 1)


class PathType(click.Path):
    """Path type that rejects broken links and empty paths; an empty path would mean the working directory."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Any:
        """Return the path, or raise a usage error."""
        if str(value) == "":
            self.fail("the path is empty", param, ctx)
        if os.path.islink(value) and not os.path.exists(value):
            self.fail(f"{value} is a broken link: its target does not exist", param, ctx)
        return super().convert(value, param, ctx)


FILE = PathType(path_type=Path, dir_okay=False)
"""Type of an option with the path of a file."""
FOLDER = PathType(path_type=Path, file_okay=False)
"""Type of an option with the path of a folder."""
PATH = PathType(path_type=Path)
"""Type of an option with the path of a file or a folder."""
COUNT = click.IntRange(min=1)
"""Type of an option with a positive number."""
MAX_SEED = 2**32 - 1
"""Maximum seed: every random number generator accepts a seed of 32 bits."""
mission_argument = click.argument("mission", metavar="MISSION")


def check_usage(*errors: tuple[object, str]) -> None:
    """Raise a UsageError for the first true condition; each error is a pair of condition and message."""
    for condition, message in errors:
        if condition:
            raise click.UsageError(message)


make_overrides_option = partial(click.option, metavar="KEY=VALUE", multiple=True, callback=_parse_overrides)
"""Make a repeatable option with values KEY=VALUE.

Arguments: the option name, the parameter name, and `help`.
"""
overrides_option = make_overrides_option(
    "--set", "overrides",
    help="Set a param of the mission, or a key of the cell: cell.KEY.KEY=VALUE; repeatable.",
)  # fmt: skip
variations_option = click.option(
    "--vary", "variations", metavar="KEY=[VALUE, ...]", multiple=True, callback=_parse_variations,
    help="Run every seed with each of these values of KEY (see --set); repeatable, all combinations are run.",
)  # fmt: skip
runs_option = click.option("--runs", "runs_folder", type=FOLDER, default="runs", help="Folder of the runs.")
json_option = click.option("--json", "as_json", is_flag=True, help="Print the result as JSON on stdout.")
seed_option = click.option("--seed", type=click.IntRange(0, MAX_SEED), default=0, help="Random seed.")
cell_option = click.option(
    "--cell", metavar="CELL", default="", help="Cell file or shipped cell instead of the cell of the mission."
)
scene_option = click.option(
    "--scene", type=FILE,
    help="Scene file: differences of the simulated world from the cell file (light, table, objects, camera).",
)  # fmt: skip
video_option = click.option(
    "--video", type=FILE, help="File (.mp4 or .gif) for a video of the run; only for simulated cells."
)
force_option = click.option("--force", is_flag=True, help="Overwrite an existing video.")
workers_option = click.option("--workers", type=COUNT, default=2, help="Number of parallel processes.")
oracle_option = click.option(
    "--oracle", is_flag=True,
    help="Take detections from the simulated world instead of images; a run then takes about two seconds.",
)  # fmt: skip
_SWEEP_OPTIONS = (
    click.option(
        "--seeds", type=_parse_seed_range, metavar="FIRST:END",
        help="Seeds of the runs; FIRST:END excludes END, FIRST-LAST includes LAST.",
    ),
    workers_option,
    click.option(
        "--cluster", metavar="ADDRESS",
        help="Run on the workers of a dask scheduler, for example tcp://scheduler:8786 (extra: cluster).",
    ),
    click.option(
        "--frames", "save_images", is_flag=True,
        help="Save the camera images on which decisions are based.",
    ),
    overrides_option, cell_option, scene_option, runs_option, json_option,
)  # fmt: skip
"""Options that the commands `sweep` and `compare` share."""


def add_sweep_options(command: CommandT) -> CommandT:
    """Add the options that the commands `sweep` and `compare` share."""
    for add_option in reversed(_SWEEP_OPTIONS):
        command = add_option(command)
    return command


def check_disjoint(overrides: Mapping[str, str], options: str, values: Mapping[str, object]) -> None:
    """Raise a usage error if a key is in both mappings; `options` names the options of the second mapping."""
    for key in overrides.keys() & values.keys():
        raise click.UsageError(f"{key} is set with --set and also with {options}; omit one of them")


def is_any_given(ctx: click.Context, *names: str) -> bool:
    """Return True if the command line gives a value for one of these parameters."""
    return any(ctx.get_parameter_source(name) is not ParameterSource.DEFAULT for name in names)


def check_video(file: Path, cell_kind: str, *, force: bool) -> None:
    """Raise an InputError if the video of a run in a cell of `cell_kind` cannot be written to a file.

    An existing file is an error unless `force` is true.
    """
    if file.suffix.lower() not in (".mp4", ".gif"):
        raise InputError(f'"{file}" cannot be a video; give a file name that ends in .mp4 or .gif')
    if file.exists() and not force:
        raise InputError(f'"{file}" exists; name another file with --video, or overwrite it with --force')
    if not file.parent.is_dir():
        raise InputError(f'cannot write the video "{file}": its folder does not exist')
    if cell_kind != "sim":
        advice = "omit --video, or use a cell of `kind: sim`"
        raise InputError(f"a video needs a simulated world, but this cell has `kind: {cell_kind}`; {advice}")
