"""`executive bench`: measurements that other figures rest on, one per file."""

from __future__ import annotations

import click

from executive.cli.bench.halts import halts
from executive.cli.bench.journal import journal
from executive.cli.bench.kills import kills
from executive.cli.bench.motion import motion
from executive.cli.bench.seal import seal
from executive.cli.bench.soak import soak
from executive.cli.bench.tick import tick


@click.group(name="bench")
def command() -> None:
    """Measure what other figures rest on."""


for measurement in (seal, tick, motion, journal, halts, kills, soak):
    command.add_command(measurement)
