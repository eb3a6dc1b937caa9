"""What commands share: options and arguments, streams that tolerate write errors, results and progress bars.

The functions import rich themselves, because a command that needs no rich would wait 0.1 s.
"""

from __future__ import annotations

import contextlib
import ctypes
import io
import json
import math
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TextIO, TypeVar, cast

import click
from click.core import ParameterSource

from executive.errors import InputError, escape_control_characters

if TYPE_CHECKING:
    from rich.console import RenderableType

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
        except (yaml.YAMLError, RecursionError):
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
    click.option("--dry-run", is_flag=True, help="Print the number of runs, and the files for --cluster."),
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


class TolerantStream:
    """Text stream that escapes control characters, and drops all output after the first write error.

    Args:
        stream: Underlying stream.
        escapes: False to write control characters unchanged, for a library that draws on the terminal.

    Attributes:
        stream: Underlying stream.
        error: Message of the first write error, or "".
    """

    def __init__(self, stream: TextIO, *, escapes: bool = True) -> None:
        if isinstance(stream, io.TextIOWrapper):
            # By default, a character that the encoding lacks would cause an error.
            stream.reconfigure(errors="backslashreplace")
        self.stream = stream
        self.encoding = stream.encoding
        self.isatty = stream.isatty
        self.fileno = stream.fileno
        self._escapes = escapes
        self.error = ""

    def write(self, text: str) -> int:
        """Write `text`; drop the text if a write has failed."""
        with self._tolerate_errors():
            self.stream.write(escape_control_characters(text) if self._escapes else text)
        return len(text)

    def flush(self) -> None:
        """Flush the buffer of the stream."""
        with self._tolerate_errors():
            self.stream.flush()

    @contextlib.contextmanager
    def _tolerate_errors(self) -> Iterator[None]:
        try:
            yield
        except (OSError, ValueError) as error:  # A closed stream raises a ValueError.
            self.error = getattr(error, "strerror", "") or str(error)
            # Later writes, and the flush at the end of the process, go to the null device.
            with contextlib.suppress(OSError), open(os.devnull, "w") as null_file:
                os.dup2(null_file.fileno(), self.stream.fileno())


def open_unescaped_stderr() -> TextIO:
    """Return stderr without escaping of control characters, for a library that draws on the terminal."""
    return cast(TextIO, TolerantStream(getattr(sys.stderr, "stream", sys.stderr), escapes=False))


@contextlib.contextmanager
def use_tolerant_streams() -> Iterator[None]:
    """Make stdout and stderr tolerant in this context; at its end, report a write error of stdout."""
    # Otherwise, a file that is opened later would get the descriptor and the output of a closed stream.
    while (descriptor := os.open(os.devnull, os.O_RDWR)) <= 2:
        pass
    os.close(descriptor)
    # `print`, click and rich use no other attributes of a stream than the class has.
    stdout: Any = TolerantStream(sys.stdout or io.StringIO())
    stderr: Any = TolerantStream(sys.stderr or io.StringIO())
    with contextlib.redirect_stdout(stdout), contextlib.redirect_stderr(stderr):
        try:
            yield
        finally:
            stdout.flush()
            if stdout.error:
                stderr.write(f"note: standard output could not be written: {stdout.error}\n")
            stderr.flush()


@contextlib.contextmanager
def keep_stdout_clean() -> Iterator[None]:
    """Redirect Python's stdout to stderr, and drop the stdout of C libraries (pybullet), in this context."""
    sys.stdout.flush()
    real_stdout = os.dup(1)
    try:
        with open(os.devnull, "w") as null_file:
            os.dup2(null_file.fileno(), 1)
        with contextlib.redirect_stdout(sys.stderr):
            yield
    finally:
        # Without a flush, the C library would write its buffer to the real stdout later.
        ctypes.CDLL(None).fflush(None)
        os.dup2(real_stdout, 1)
        os.close(real_stdout)


def print_json(value: Any) -> None:
    """Print `value` to stdout as one JSON object or array."""
    # Another encoding than UTF-8 lacks most characters; a closed stream has no encoding.
    is_ascii_only = (getattr(sys.stdout, "encoding", None) or "utf-8").lower() != "utf-8"
    click.echo(json.dumps(value, indent=2, ensure_ascii=is_ascii_only, allow_nan=False))


def print_result(value: Any, text: str, *, as_json: bool) -> None:
    """Print the result of a command to stdout: `value` as JSON, or `text`."""
    print_json(value) if as_json else click.echo(text)


@contextlib.contextmanager
def show_progress(description: str, *, quiet: bool = False) -> Iterator[Callable[[int, int], None]]:
    """Show a progress bar with rate and remaining time if stderr is a terminal; yield the update function.

    The arguments of the update function are the numbers of completed parts and of all parts of the work.

    Args:
        description: Name of the work, beside the bar.
        quiet: True to show nothing.
    """
    from rich import progress
    from rich.console import Console

    console = Console(file=open_unescaped_stderr())
    is_hidden = quiet or not console.is_interactive
    # The remaining time is estimated from all completed parts, because a part may take minutes.
    with progress.Progress(
        progress.TextColumn("{task.description}"), progress.BarColumn(), progress.MofNCompleteColumn(),
        progress.TextColumn("{task.fields[rate]}"), progress.TimeRemainingColumn(),
        console=console, disable=is_hidden, speed_estimate_period=math.inf,
    ) as bar:  # fmt: skip
        task = bar.add_task(description, total=None, rate="")

        def update(completed: int, total: int) -> None:
            bar.update(task, completed=completed, total=total)
            if speed := bar.tasks[0].speed:
                bar.update(task, rate=f"{60 * speed:.1f} per minute")

        yield update


def print_report(lines_and_tables: Iterable[RenderableType]) -> None:
    """Print lines of text, which are not wrapped, and tables to stderr."""
    from rich.console import Console

    console = Console(stderr=True, highlight=False, markup=False, force_terminal=False)
    for line_or_table in lines_and_tables:
        console.print(line_or_table, soft_wrap=isinstance(line_or_table, str))


def print_halt() -> None:
    """Print the consequences of the received Ctrl-C or SIGTERM."""
    click.echo("halting: no new runs start, and current runs end", err=True)
