"""The command line of a program of this project that runs in a process of its own."""

from __future__ import annotations

import sys


def program(module: str, *words: str) -> list[str]:
    """Return the command that runs a module with the interpreter of this process.

    `python -m` would look into the working directory first: a file of a library's name beside somebody's
    mission would be run in its place.
    """
    start = (
        "import sys; sys.path[:] = filter(None, sys.path); "
        "module = sys.argv.pop(1); import runpy; runpy.run_module(module, None, '__main__')"
    )
    return [sys.executable, "-c", start, module, *words]
