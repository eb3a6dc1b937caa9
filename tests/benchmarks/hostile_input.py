"""Commands with hostile input: internal errors, exit codes, time, memory and control characters.

Each command runs in a forked child process, so that all modules are imported already. A command has a
problem if it has an internal error, exceeds a limit, ends with another exit code than 0, 1, 2 or 4, or prints
a control character or one character more than 200 times in a row.
"""

from __future__ import annotations

import json
import os
import re
import resource
import signal
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

import click

from executive.cli.main import COMMANDS, main
from executive.cli.options import seed_option
from executive.plugins import load_skills
from tests.benchmarks.hostile_files import Arguments, TextMaker, write_data_set, write_model, write_odd_paths
from tests.benchmarks.report import Figures, run_command, show_progress

MAX_CPU_TIME = 5.0
"""Largest accepted CPU time of a command, without the import of Python modules [s]."""
MAX_MEMORY = 300.0
"""Largest accepted resident memory of `check` [MB]."""
MAX_WALL_TIME = 60
"""Wall time after which a command is killed [s]."""
EXIT_CODES = (0, 1, 2, 4)
"""Exit codes that a command with hostile input may have."""
FORBIDDEN = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f]|(.)\1{200}")
"""Control characters but tab and new line, and one character more than 200 times in a row."""

Writer = Callable[[int, Path], Arguments]
"""Writes the files of the case with a seed into a folder, and returns a command."""


@dataclass(frozen=True)
class CommandResult:
    """Result of a command: exit code, standard output and error, CPU time [s] and peak memory [MB]."""

    exit_code: int
    output: str
    errors: str
    cpu_time: float
    memory: float


def measure(texts: int, data_sets: int, models: int, seed: int) -> Figures:
    """Run commands with hostile missions, cells, libraries, data sets, models and paths."""
    for name in COMMANDS:
        import_module(f"executive.cli.{name}")
    load_skills()
    groups: list[tuple[str, int, Writer]] = [
        ("texts", texts, TextMaker().write),
        ("data sets", data_sets, write_data_set),
        ("models", models // 2, write_model),
        ("paths", models - models // 2, write_odd_paths),
    ]
    rows, problems = [], []
    for group, number, write in groups:
        results = []
        for case in show_progress(range(seed, seed + number), group):
            result, arguments, found = run_case(write, case)
            results.append(result)
            problems += [f"{group} {case}, {' '.join(arguments)[:80]}: {problem}" for problem in found]
        rows.append({"group": group, **_summarize(results)})
    return {"seed": seed, "groups": rows, "problems": problems}


def run_case(write: Writer, case: int) -> tuple[CommandResult, Arguments, list[str]]:
    """Run the command of a case in a new folder, and return its result, its arguments and its problems."""
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as logs:
        arguments = write(case, Path(folder))
        result = run_in_child(lambda: main(arguments), Path(folder), Path(logs))
    return result, arguments, find_problems(arguments, result)


def run_in_child(command: Callable[[], object], folder: Path, logs: Path) -> CommandResult:
    """Run a command, which ends with SystemExit, in a forked child whose working directory is `folder`."""
    outputs = [logs / "output.txt", logs / "errors.txt"]
    child = os.fork()
    if child == 0:
        try:
            os.chdir(folder)
            for descriptor, file in zip((1, 2), outputs, strict=True):
                os.dup2(os.open(file, os.O_WRONLY | os.O_CREAT), descriptor)
            sys.stdout, sys.stderr = (os.fdopen(os.dup(number), "w") for number in (1, 2))
            os.environ["TMPDIR"] = tempfile.tempdir = str(logs)
            command()
        except SystemExit as end:
            sys.stdout.flush()
            sys.stderr.flush()
            os._exit(end.code if isinstance(end.code, int) else 0)
        finally:
            os._exit(99)
    status, usage = _wait(child)
    texts = [file.read_bytes().decode(errors="backslashreplace") for file in outputs]
    cpu_time = usage.ru_utime + usage.ru_stime
    return CommandResult(
        os.waitstatus_to_exitcode(status), texts[0], texts[1], cpu_time, usage.ru_maxrss / 1e3
    )


def find_problems(arguments: Arguments, result: CommandResult) -> list[str]:
    """Return everything that is wrong with the result of a command."""
    text = result.output + result.errors
    problems = []
    if "internal error" in text or "Traceback" in text:
        problems.append(f"an internal error: {text[-300:]}")
    if result.exit_code not in EXIT_CODES:
        problems.append(f"exit code {result.exit_code}: {text[-300:]}")
    if result.cpu_time > MAX_CPU_TIME:
        problems.append(f"{result.cpu_time:.1f} s of CPU time; {MAX_CPU_TIME:g} s are allowed")
    if result.memory > MAX_MEMORY and arguments[0] == "check":
        problems.append(f"{result.memory:.0f} MB of memory; {MAX_MEMORY:g} MB are allowed")
    if found := FORBIDDEN.search(text):
        problems.append(f"prints {found[0][:20]!r}: {text[max(found.start() - 60, 0) : found.end()][:300]!r}")
    if result.exit_code and not text.strip():
        problems.append(f"exit code {result.exit_code} without a message")
    if "--json" in arguments and result.output:
        try:
            json.loads(result.output)
        except ValueError as error:
            problems.append(f"standard output is no JSON: {error}")
    return problems


def _wait(child: int) -> tuple[int, resource.struct_rusage]:
    """Wait for a child, kill it after `MAX_WALL_TIME`, and return its status and its use of resources."""
    end = time.monotonic() + MAX_WALL_TIME
    while True:
        pid, status, usage = os.wait4(child, os.WNOHANG)
        if pid:
            return status, usage
        if time.monotonic() > end:
            os.kill(child, signal.SIGKILL)
        time.sleep(0.002)


def _summarize(results: list[CommandResult]) -> Figures:
    codes = Counter(result.exit_code for result in results)
    return {
        "cases": len(results),
        "exit codes": ", ".join(f"{number} × {code}" for code, number in sorted(codes.items())),  # noqa: RUF001
        "cpu_time_s": max((result.cpu_time for result in results), default=0.0),
        "memory_mb": max((result.memory for result in results), default=0.0),
    }


if __name__ == "__main__":
    number = click.IntRange(min=0)
    run_command(
        measure,
        click.option("--texts", type=number, default=5000, help="Number of mission, cell and library files."),
        click.option("--data-sets", type=number, default=300, help="Number of data sets."),
        click.option("--models", type=number, default=300, help="Number of models and paths."),
        seed_option,
    )
