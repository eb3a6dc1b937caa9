"""`executive faults`: inject faults into a mission, and judge how its runs end."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import click

from executive.cli import options
from executive.cli.streams import print_json, stdout_kept_clean


def parse_fault_numbers(text: str) -> tuple[int, ...]:
    """Return the fault numbers in a text such as `12`, or `3+12` for two faults in one run."""
    if re.fullmatch(r"\d+(\+\d+)*", text) is None:
        raise click.BadParameter(f'"{text}" is no fault; write it as 12, or 3+12 for two at once')
    return tuple(dict.fromkeys(int(number) for number in text.split("+")))


@click.command(name="faults")
@options.MISSION
@options.oracle_option
@click.option(
    "--pairs", type=options.COUNT, help="Number of random pairs of faults to inject instead of single faults."
)
@click.option(
    "--fault", "numbers", type=parse_fault_numbers, metavar="N[+M]",
    help="Inject only this fault, and record its run.",
)  # fmt: skip
@click.option(
    "--list", "is_list", is_flag=True, help="Print the faults, and run only the undisturbed mission."
)
@options.workers_option
@options.seed_option
@options.overrides_option
@options.runs_option
@options.json_option
@click.pass_context
def command(
    ctx: click.Context, mission: str, oracle: bool, pairs: int | None, numbers: tuple[int, ...] | None,
    is_list: bool, workers: int, seed: int, overrides: dict[str, str], runs: Path, as_json: bool,
) -> None:  # fmt: skip
    """Inject each fault into a run of MISSION; exit code 1 if a run does not handle its fault.

    The faults are made from the mission's tree: every reason of every node, bugs in every skill, and faults
    of detectors, objects and the tool. If a fault of the cell makes a node fail, the same reason is not
    injected into its skill: then fewer faults are run than --list shows. A run does not handle its fault if
    it loses an object that the fault left within reach, misplaces an object, has a ledger that disagrees with
    the world, or ends in any other disorder.
    """
    if sum((pairs is not None, numbers is not None, is_list)) > 1:
        raise click.UsageError("--pairs, --fault and --list exclude each other")
    with stdout_kept_clean():
        from executive.campaign.faults.campaign import Campaign
        from executive.campaign.faults.trial import record_trial
        from executive.campaign.mission_under_test import load_mission_under_test
        from executive.cli.progress import bar, print_halting
        from executive.view.figures.fault import format_results, format_trial, results_to_json, trial_to_json

        subject = load_mission_under_test(mission, overrides, oracle, seed)
        with bar("tried", quiet=as_json or is_list or numbers is not None) as progress:
            campaign = Campaign(subject, workers=workers, progress=progress, on_halt=print_halting)
            plain: Any
            if is_list:
                listed = enumerate(campaign.faults, 1)
                plain = [{"fault": number, "description": str(fault)} for number, fault in listed]
                text, code = "\n".join(f"{fault['fault']:4} {fault['description']}" for fault in plain), 0
            elif numbers is not None:
                faults = campaign.select_faults(numbers)
                trial, path = record_trial(subject, campaign.nominal_run, faults, runs)
                plain = {**trial_to_json(trial), "run": str(path)}
                text, code = f"{format_trial(trial)}\n{path}", int(bool(trial.problems))
            else:
                figures = campaign.run_fault_pairs(pairs) if pairs else campaign.run_single_faults()
                plain, text = results_to_json(figures), format_results(figures)
                code = int(bool(figures.failed_trials)) if figures.complete else 130
    print_json(plain) if as_json else click.echo(text)
    ctx.exit(code)
