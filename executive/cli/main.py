"""Command group `executive`: runs the requested command, and reports errors by message and exit code."""

from __future__ import annotations

import difflib
import gc
import io
import sys
import tempfile
import threading
import traceback
from collections.abc import Mapping, Sequence
from importlib import import_module
from typing import Any

import click

from executive.cli.shared import use_tolerant_streams
from executive.errors import ExecutiveError, ExitCode, shorten_quotations, to_text
from executive.run.operator import HALT_SIGNALS, handle_signals, interrupt

COMMANDS: Mapping[str, str] = {
    "run": "run",
    "check": "check",
    "tree": "check",
    "skills": "check",
    "schema": "check",
    "dataset": "training",
    "train": "training",
    "evaluate": "training",
    "sweep": "sweep",
    "compare": "sweep",
    "faults": "sweep",
    "replay": "run",
    "report": "run",
    "arm": "arm",
    "doctor": "setup",
    "init": "setup",
}
"""Module in `executive.cli` of each command, in the order of `--help`."""

START_THRESHOLD = 100_000
"""Number of new objects after which Python collects garbage during the start of a command.

The number is large, because imports create many objects that remain."""


class CommandGroup(click.Group):
    """Command group that imports only the requested command and exits with the documented exit codes."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        """Return the names of all commands."""
        del ctx
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Return the command with the name `cmd_name`; None if there is no such command."""
        del ctx
        if cmd_name not in COMMANDS:
            return None
        module = import_module(f"executive.cli.{COMMANDS[cmd_name]}")
        command: click.Command = getattr(module, f"{cmd_name}_command")
        return command

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command with the name `args[0]`; suggest a command if the name is misspelled."""
        suggestions = difflib.get_close_matches(args[0], COMMANDS, n=1)
        if args[0] not in COMMANDS and suggestions and not args[0].startswith("-"):
            ctx.fail(f'there is no command "{args[0]}"; did you mean "{suggestions[0]}"?')
        return super().resolve_command(ctx, args)

    def main(self, args: Sequence[str] | None = None, *_: Any, **options: Any) -> Any:
        """Run a command and exit with its exit code; tracebacks are printed only with `--debug`."""
        args = list(sys.argv[1:] if args is None else args)
        gc.set_threshold(START_THRESHOLD)
        with use_tolerant_streams():
            try:
                with handle_signals(HALT_SIGNALS, interrupt):
                    exit_code = super().main(args, **{**options, "standalone_mode": False})
            except BaseException as error:
                # Also a `SystemExit` of a plugin: the exit code is that of the command.
                exit_code = _show_error(error, debug="--debug" in args)
        sys.exit(exit_code if isinstance(exit_code, int) else 0)


def _show_error(error: BaseException, *, debug: bool) -> ExitCode:
    """Print the error of a command to stderr, and return the exit code."""
    if isinstance(error, click.ClickException):
        message_buffer = io.StringIO()
        error.show(message_buffer)
        click.echo(shorten_quotations(message_buffer.getvalue()), err=True, nl=False)
        return ExitCode.INVALID_INPUT
    if isinstance(error, click.Abort | KeyboardInterrupt):
        click.echo("halted", err=True)
        return ExitCode.HALTED
    if debug:
        traceback.print_exception(error)
    if isinstance(error, ExecutiveError):
        click.echo(str(error), err=True)
        return error.exit_code
    if isinstance(error, OSError) and error.filename:
        click.echo(shorten_quotations(f"{error.filename}: {error.strerror}"), err=True)
        return ExitCode.INVALID_INPUT
    if not debug:
        click.echo(_save_traceback(error), err=True)
    return ExitCode.FAULT


def _save_traceback(error: BaseException) -> str:
    """Write the traceback of `error` to a file, and return a message with the path of the file."""
    with tempfile.NamedTemporaryFile(
        "w", prefix="executive-", suffix=".txt", delete=False, encoding="utf-8", errors="backslashreplace"
    ) as file:
        traceback.print_exception(error, file=file)
    text = shorten_quotations(f"{type(error).__name__}: {to_text(error)}")
    advice = f"{file.name} contains the traceback, and `executive --debug ...` prints it"
    return f"internal error ({text}); {advice}"


@click.group(cls=CommandGroup, context_settings={"help_option_names": ["-h", "--help"], "show_default": True})
@click.version_option(package_name="pick-place-executive", prog_name="executive")
@click.option("--debug", is_flag=True, help="Print the traceback of an error.")
def main(debug: bool) -> None:
    """Run pick-and-place missions written as behaviour trees in YAML.

    Exit codes: 0 success, 1 mission failed or the audit disagrees, 2 invalid input, 3 fault, 4 incomplete
    (objects were rejected), 130 halted by the user.
    """
    del debug  # `CommandGroup.main` reads the option, because it also handles errors outside of commands.


def run_command_line() -> None:
    """Run the command in `sys.argv`, and end this process with its exit code."""
    try:
        main()
    except SystemExit as end:
        if threading.active_count() > 1:
            # The import takes 15 ms, for which `--help` must not wait.
            from executive.processes import limit_end_time

            limit_end_time(int(end.code or 0))
        raise


if __name__ == "__main__":
    run_command_line()
