"""`executive faults`: inject faults into runs of a mission, and judge how the runs end."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import click

from executive.cli import options
from executive.cli.streams import keep_stdout_clean, print_json
from executive.errors import ExitCode


def parse_fault_numbers(text: str) -> tuple[int, ...]:
    """Return the fault numbers in a text such as `12`, or `3+12` for two faults in one run."""
    if re.fullmatch(r"\d+(\+\d+)*", text) is None:
        raise click.BadParameter(f'"{text}" is not a fault; write its number, or 3+12 for two faults')
    return tuple(dict.fromkeys(int(number) for number in text.split("+")))


@click.command(name="faults")
@options.mission_argument
@options.oracle_option
@click.option("--pairs", type=options.COUNT, help="Inject this number of random pairs of faults.")
@click.option(
    "--fault", "fault_numbers", type=parse_fault_numbers, metavar="N[+M]",
    help="Inject only the fault N of --list, or N and M together, and record the run.",
)  # fmt: skip
@click.option("--list", "list_only", is_flag=True, help="Print the faults without injecting them.")
@options.workers_option
@options.seed_option
@options.overrides_option
@options.runs_option
@options.json_option
def command(
    mission: str, oracle: bool, pairs: int | None, fault_numbers: tuple[int, ...] | None,
    list_only: bool, workers: int, seed: int, overrides: dict[str, str], runs_folder: Path, as_json: bool,
) -> int:  # fmt: skip
    """Inject each possible fault into a run of a mission.

    MISSION is a file or the name of a shipped mission. Its tree determines the faults: every reason of every
    node, bugs in every skill, and faults of detectors, objects and the tool. A node failure that a
    cell fault causes is not injected again, so that fewer faults are injected than --list prints.
    Exit code 1 if a run does not handle its fault: the run loses an object within reach, misplaces an object,
    does not end correctly, or has a ledger that differs from the world.
    """
    has_conflict = sum((pairs is not None, fault_numbers is not None, list_only)) > 1
    options.check_usage((has_conflict, "--pairs, --fault and --list exclude each other; give one of them"))
    with keep_stdout_clean():
        from executive.campaign import faults as fault_campaign
        from executive.campaign.jobs import JobOptions, load_mission_under_test
        from executive.cli.progress import print_halt, show_progress

        mission_under_test = load_mission_under_test(mission, overrides, oracle, seed)
        with show_progress("faults", quiet=as_json or list_only or fault_numbers is not None) as progress:
            campaign = fault_campaign.Campaign(mission_under_test, JobOptions(workers, progress, print_halt))
            output: Any
            exit_code = 0
            if list_only:
                output = [
                    {"fault": number, "description": str(fault)}
                    for number, fault in enumerate(campaign.faults, start=1)
                ]
                text = "\n".join(f"{entry['fault']:4} {entry['description']}" for entry in output)
            elif fault_numbers is not None:
                faults = campaign.select_faults(fault_numbers)
                nominal_run = campaign.nominal_run
                trial = fault_campaign.run_trial(mission_under_test, faults, nominal_run, runs_folder)
                output = fault_campaign.trial_to_json(trial)
                text = "\n".join(fault_campaign.list_trial_lines(trial))
                exit_code = int(bool(trial.problems))
            else:
                campaign.run_fault_pairs(pairs) if pairs else campaign.run_single_faults()
                output = fault_campaign.results_to_json(campaign)
                text = "\n".join(fault_campaign.list_result_lines(campaign))
                has_problems = any(trial.problems for trial in campaign.trials)
                exit_code = int(has_problems) if campaign.is_complete else ExitCode.HALTED
    print_json(output) if as_json else click.echo(text)
    return exit_code
