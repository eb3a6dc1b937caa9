"""Commands of many runs: `sweep`, `compare` and `faults`."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from executive.cli import shared
from executive.errors import ExitCode

if TYPE_CHECKING:
    from executive.campaign.results import SweepSettings
    from executive.campaign.sweep_summary import SweepResults


@click.command(name="sweep")
@click.argument("mission", metavar="MISSION", required=False)
@shared.variations_option
@click.option(
    "--resume", type=shared.PATH, metavar="SWEEP",
    help="Execute the missing runs of an interrupted sweep, given by its folder or its file results.sqlite.",
)  # fmt: skip
@shared.add_sweep_options
@click.option(
    "--require", metavar="EXPR",
    help='Exit with code 1 if the runs do not meet EXPR, such as "success>=0.99 and p95(robot_time_s)<20".',
)  # fmt: skip
@click.option("--junit", type=shared.FILE, help="Write a report in the JUnit XML format to this file.")
@click.pass_context
def sweep_command(
    ctx: click.Context, mission: str | None, seeds: range | None, variations: dict[str, tuple[str, ...]],
    resume: Path | None, workers: int, cluster: str | None, dry_run: bool, save_images: bool,
    overrides: dict[str, str], cell: str, scene: Path | None, runs_folder: Path, require: str | None,
    junit: Path | None, as_json: bool,
) -> int:  # fmt: skip
    """Run a mission once for every seed and variant, and summarize the runs.

    MISSION is a file or the name of a shipped mission. A new folder below --runs contains results.sqlite, the
    page results.html, and the run directories. A run gets a report if it did not succeed or if the audit
    contradicts the ledger; `executive report` writes the report of any other run. Exit code 1 if --require is
    not met. Ctrl-C ends the current runs; then the results of the complete runs are printed. A second Ctrl-C
    quits immediately.
    """
    names = ("mission", "seeds", "variations", "overrides", "save_images", "cell", "scene")
    has_settings = resume is not None and shared.is_any_given(ctx, *names)
    lacks_input = resume is None and (mission is None or seeds is None)
    shared.check_usage(
        (lacks_input, "give a MISSION and --seeds, or --resume SWEEP"),
        (has_settings, "--resume takes mission, seeds and settings from the sweep; omit them"),
        (dry_run and (resume or as_json), "--dry-run prints a text; omit --resume and --json"),
    )
    shared.check_disjoint(overrides, "--vary", variations)
    with shared.keep_stdout_clean():
        # The imports take half a second, for which `--help` and wrong options must not wait.
        from executive.campaign import sweep_reports
        from executive.campaign.jobs import JobOptions
        from executive.campaign.sweep import create_sweep, make_settings, open_sweep, read_results, run_sweep
        from executive.cell.json_values import to_json

        conditions = sweep_reports.parse_requirement(require) if require else ()
        if resume is not None:
            database = open_sweep(resume)
        else:
            assert mission is not None
            assert seeds is not None
            settings = make_settings(mission, seeds, overrides, variations, scene, save_images, cell)
            if dry_run:
                return _print_plan([settings], cluster)
            database = create_sweep(settings, runs_folder)
        with closing(database):
            click.echo(f"results: {database.path}", err=True)
            with shared.show_progress(database.settings.mission) as progress:
                run_sweep(database, JobOptions(workers, progress, shared.print_halt), cluster)
            results = read_results(database)
        shared.print_report(sweep_reports.render_summary(results))
        page = sweep_reports.write_page(database.path.parent, [results])
        click.echo(f"page: {page}", err=True)
        if junit is not None:
            sweep_reports.write_junit(junit, results)
        unmet_conditions = sweep_reports.describe_unmet_conditions(conditions, results)
        for message in unmet_conditions:
            click.echo(message, err=True)
    if as_json:
        shared.print_json(to_json({
            "settings": results.settings, "results": str(database.path), "page": str(page),
            "planned_run_count": results.settings.run_count, "is_incomplete": results.is_incomplete,
            "variants": results.summaries, "unmet_conditions": unmet_conditions, "runs": results.runs,
        }))  # fmt: skip
    return _find_exit_code([results]) or ExitCode(int(bool(unmet_conditions)))


def _print_plan(sweeps: Sequence[SweepSettings], cluster: str | None) -> ExitCode:
    """Print the number of runs of each sweep, and the files that would travel to a cluster."""
    from executive.campaign.sweep import import_cluster

    for settings in sweeps:
        files = sorted(import_cluster().list_bundle(settings)) if cluster else []
        lines = [f"{settings.run_count} runs of {settings.mission}; {len(files)} files travel", *files]
        shared.print_report(lines)
    return ExitCode.SUCCESS


def _find_exit_code(sweeps: Sequence[SweepResults]) -> ExitCode:
    """Return HALTED if runs are missing, and FAULT if runs failed because of their environment."""
    if count := sum(run.reason == "environment" for sweep in sweeps for run in sweep.runs):
        causes = "disk, memory or a killed process"
        click.echo(f"runs that failed because of {causes}: {count}; --resume repeats them", err=True)
    if any(sweep.is_incomplete for sweep in sweeps):
        return ExitCode.HALTED
    return ExitCode.FAULT if count else ExitCode.SUCCESS


@click.command(name="compare")
@click.argument("missions", metavar="A [B]", nargs=-1)
@shared.make_overrides_option("--set-a", "overrides_a", help="Like --set, but only for A; repeatable.")
@shared.make_overrides_option("--set-b", "overrides_b", help="Like --set, but only for B; repeatable.")
@click.option("--cell-a", default="", metavar="CELL", help="Like --cell, but only for A.")
@click.option("--cell-b", default="", metavar="CELL", help="Like --cell, but only for B.")
@click.option(
    "--resume", type=shared.FOLDER, metavar="FOLDER",
    help="Execute the missing runs of the interrupted comparison in this folder.",
)  # fmt: skip
@shared.add_sweep_options
@click.pass_context
def compare_command(
    ctx: click.Context, missions: tuple[str, ...], seeds: range | None, overrides_a: dict[str, str],
    overrides_b: dict[str, str], cell_a: str, cell_b: str, resume: Path | None, workers: int,
    cluster: str | None, dry_run: bool, save_images: bool, overrides: dict[str, str], cell: str,
    scene: Path | None, runs_folder: Path, as_json: bool,
) -> int:  # fmt: skip
    """Run the missions A and B once for every seed, and estimate the differences.

    A and B are files or names of shipped missions. A single mission is used as A and as B, and --set-a,
    --set-b, --cell-a and --cell-b state the difference. The results of both are stored in a/results.sqlite
    and b/results.sqlite in a folder below --runs. Each difference has a 95 % confidence interval.
    Ctrl-C ends the current runs; then the results of the complete pairs are printed.
    """
    names = (
        "missions", "seeds", "overrides", "overrides_a", "overrides_b", "cell", "cell_a", "cell_b",
        "save_images", "scene",
    )  # fmt: skip
    has_settings = resume is not None and shared.is_any_given(ctx, *names)
    lacks_input = resume is None and (len(missions) not in (1, 2) or seeds is None)
    shared.check_usage(
        (lacks_input, "give one or two missions and --seeds, or --resume FOLDER"),
        (has_settings, "--resume takes missions, seeds and settings from the comparison; omit them"),
        (dry_run and (resume or as_json), "--dry-run prints a text; omit --resume and --json"),
        (cell and (cell_a or cell_b), "--cell is for A and B; omit it, or omit --cell-a and --cell-b"),
    )
    shared.check_disjoint(overrides, "--set-a or --set-b", {**overrides_a, **overrides_b})
    with shared.keep_stdout_clean():
        # The imports take half a second, for which `--help` and wrong options must not wait.
        from executive.campaign import sweep, sweep_reports
        from executive.campaign.jobs import JobOptions
        from executive.campaign.sweep_summary import compute_differences, pair_runs
        from executive.cell.json_values import to_json

        if resume is not None:
            databases = sweep.open_comparison(resume)
        else:
            assert seeds is not None
            sides = ((missions[0], overrides_a, cell_a), (missions[-1], overrides_b, cell_b))
            settings = [
                sweep.make_settings(name, seeds, overrides | own, {}, scene, save_images, own_cell or cell)
                for name, own, own_cell in sides
            ]
            if dry_run:
                return _print_plan(settings, cluster)
            databases = sweep.create_comparison(settings, runs_folder)
        results: list[SweepResults] = []
        for side, database in zip("AB", databases, strict=True):
            with closing(database):
                if not any(result.is_incomplete for result in results):
                    with shared.show_progress(f"{side}: {database.settings.mission}") as progress:
                        sweep.run_sweep(database, JobOptions(workers, progress, shared.print_halt), cluster)
                results.append(sweep.read_results(database, side))
        pairs = pair_runs(results[0].runs, results[1].runs)
        differences = compute_differences(pairs)
        changed_pairs = [pair for pair in pairs if pair.is_changed]
        sweep_reports.write_missing_reports(changed_pairs)
        page = sweep_reports.write_page(databases[0].path.parents[1], results, differences, changed_pairs)
        shared.print_report(sweep_reports.render_differences(differences, changed_pairs, len(pairs)))
        click.echo(f"page: {page}", err=True)
    if as_json:
        shared.print_json(to_json({
            "settings": [result.settings for result in results],
            "results": [str(database.path) for database in databases], "page": str(page),
            "pair_count": len(pairs), "differences": differences, "changed_pairs": changed_pairs,
            "summaries": [summary for result in results for summary in result.summaries],
        }))  # fmt: skip
    return _find_exit_code(results)


def parse_fault_numbers(text: str) -> tuple[int, ...]:
    """Return the fault numbers in a text such as `12`, or `3+12` for two faults in one run."""
    if re.fullmatch(r"\d+(\+\d+)*", text) is None:
        raise click.BadParameter(f'"{text}" is not a fault; write its number, or 3+12 for two faults')
    return tuple(dict.fromkeys(int(number) for number in text.split("+")))


@click.command(name="faults")
@shared.mission_argument
@shared.oracle_option
@click.option("--pairs", type=shared.COUNT, help="Inject this number of random pairs of faults.")
@click.option(
    "--fault", "fault_numbers", type=parse_fault_numbers, metavar="N[+M]",
    help="Inject only the fault N of --list, or N and M together, and record the run.",
)  # fmt: skip
@click.option("--list", "list_only", is_flag=True, help="Print the faults without injecting them.")
@shared.workers_option
@shared.seed_option
@shared.overrides_option
@shared.cell_option
@shared.runs_option
@shared.json_option
def faults_command(
    mission: str, oracle: bool, pairs: int | None, fault_numbers: tuple[int, ...] | None,
    list_only: bool, workers: int, seed: int, overrides: dict[str, str], cell: str, runs_folder: Path,
    as_json: bool,
) -> int:  # fmt: skip
    """Inject each possible fault into a run of a mission.

    MISSION is a file or the name of a shipped mission. Its tree determines the faults: every reason of every
    node, bugs in every skill, and faults of detectors, objects and the tool. A node failure that a
    cell fault causes is not injected again, so that fewer faults are injected than --list prints.
    Exit code 1 if a run does not handle its fault: the run loses an object within reach, misplaces an object,
    does not end correctly, or has a ledger that differs from the world.
    """
    has_conflict = sum((pairs is not None, fault_numbers is not None, list_only)) > 1
    shared.check_usage((has_conflict, "--pairs, --fault and --list exclude each other; give one of them"))
    with shared.keep_stdout_clean():
        # The imports take half a second, for which `--help` and wrong options must not wait.
        from executive.campaign import faults as fault_campaign
        from executive.campaign.jobs import JobOptions, load_mission_under_test

        mission_under_test = load_mission_under_test(mission, overrides, oracle, seed, cell)
        is_quiet = as_json or list_only or fault_numbers is not None
        with shared.show_progress("faults", quiet=is_quiet) as progress:
            job_options = JobOptions(workers, progress, shared.print_halt)
            campaign = fault_campaign.Campaign(mission_under_test, job_options)
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
    shared.print_result(output, text, as_json=as_json)
    return exit_code
