"""`executive doctor`: say whether this installation can work, and what to do where it cannot."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from importlib import import_module

import click

from executive.cli.doctor.finding import Finding, lines
from executive.cli.options import json_option
from executive.cli.output import print_json, stdout_kept_clean

LOOKS = (
    "python.python", "packages.packages", "opencv.opencv", "registered.registered", "renderer.renderer",
    "display.display", "packages.extras", "roboflow.key", "roboflow.server",
)  # fmt: skip
"""What is looked at, in this order: modules beside this one, and a function of each that yields findings."""


@click.command(name="doctor")
@json_option
@click.pass_context
def command(ctx: click.Context, as_json: bool) -> None:
    """Check Python, packages, what is registered, renderer, display and Roboflow's server.

    Exit code 1 if there is a problem; what is only noted keeps nothing that comes with the project from
    working.
    """
    with stdout_kept_clean():
        findings = list(examined(LOOKS))
    if as_json:
        print_json([asdict(finding) for finding in findings])
    else:
        click.echo("\n".join(lines(findings)))
    ctx.exit(int(any(finding.mark == "problem" for finding in findings)))


def examined(looks: Sequence[str]) -> Iterator[Finding]:
    """Look at everything and yield what is found, also where packages are missing that a look needs."""
    for name in looks:
        module, _, function = name.partition(".")
        try:
            look: Callable[[], Iterator[Finding]] = getattr(import_module(f"{__name__}.{module}"), function)
            yield from look()
        except ImportError as error:
            yield Finding("problem", function, f"cannot be looked at: {error}", "run `uv sync`")
