"""`executive sweep`: run a mission for many seeds, and summarize the results."""

from __future__ import annotations

import functools
from contextlib import closing
from pathlib import Path
from typing import TYPE_CHECKING

import click

from executive.cli import options
from executive.cli.streams import keep_stdout_clean, print_json
from executive.errors import ExitCode

if TYPE_CHECKING:
    from executive.campaign.results import ResultsDatabase


@click.command(name="sweep")
@click.argument("mission", metavar="MISSION", required=False)
@options.variations_option
@click.option(
    "--resume", type=options.PATH, metavar="SWEEP",
    help="Execute the missing runs of an interrupted sweep, given by its folder or its file results.sqlite.",
)  # fmt: skip
@options.add_sweep_options
@click.option(
    "--require", metavar="EXPR",
    help='Exit with code 1 if the runs do not meet EXPR, such as "success>=0.99 and p95(robot_time_s)<20".',
)  # fmt: skip
@click.option("--junit", type=options.FILE, help="Write a report in the JUnit XML format to this file.")
@click.pass_context
def command(
    ctx: click.Context, mission: str | None, seeds: range | None, variations: dict[str, tuple[str, ...]],
    resume: Path | None, workers: int, cluster: str | None, save_images: bool, overrides: dict[str, str],
    scene: Path | None, runs_folder: Path, require: str | None, junit: Path | None, as_json: bool,
) -> int:  # fmt: skip
    """Run a mission once for every seed and variant, and summarize the runs.

    MISSION is a file or the name of a shipped mission. A new folder below --runs contains results.sqlite, the
    page results.html, and the run directories. A run gets a report if it did not succeed or if the audit
    contradicts the ledger; `executive report` writes the report of any other run. Exit code 1 if --require is
    not met. Ctrl-C ends the current runs; then the results of the complete runs are printed. A second Ctrl-C
    quits immediately.
    """
    options.check_resume(
        ctx, has_missions_and_seeds=None not in (mission, seeds),
        required_arguments="a MISSION and --seeds, or --resume SWEEP",
        resumed_settings_text="mission, seeds and settings from the sweep",
    )  # fmt: skip
    options.check_disjoint(overrides, "--vary", variations)
    with keep_stdout_clean():
        from executive.campaign.requirement import describe_unmet_conditions, parse_requirement, write_junit
        from executive.campaign.results_page import write_page
        from executive.campaign.sweep import (
            create_sweep,
            make_repeat_command,
            make_settings,
            open_sweep,
            read_results,
        )
        from executive.cell.json_values import to_json
        from executive.cli.progress import print_report
        from executive.cli.sweep_tables import render_summary

        conditions = parse_requirement(require) if require else ()
        if resume is not None:
            database = open_sweep(resume)
        else:
            assert mission is not None and seeds is not None
            settings = make_settings(mission, seeds, overrides, variations, scene, save_images)
            database = create_sweep(settings, runs_folder)
        with closing(database):
            click.echo(f"results: {database.path}", err=True)
            execute_missing_runs(database, workers, cluster)
            results = read_results(database)
            print_report(render_summary(results.summaries, results.planned_run_count))
            page = write_page(database.path.parent, [results])
            click.echo(f"page: {page}", err=True)
            if junit is not None:
                make_command = functools.partial(make_repeat_command, results.settings)
                write_junit(junit, results.settings.mission_name, results.runs, make_command)
        unmet_conditions = describe_unmet_conditions(conditions, results.runs, results.summaries)
        for message in unmet_conditions:
            click.echo(message, err=True)
    if as_json:
        print_json(to_json({
            "settings": results.settings, "results": str(database.path), "page": str(page),
            "planned_run_count": results.planned_run_count, "is_incomplete": results.is_incomplete,
            "variants": results.summaries, "unmet_conditions": unmet_conditions, "runs": results.runs,
        }))  # fmt: skip
    return ExitCode.HALTED if results.is_incomplete else ExitCode(int(bool(unmet_conditions)))


def execute_missing_runs(
    database: ResultsDatabase, workers: int, cluster: str | None, side: str = ""
) -> None:
    """Execute the missing runs of a sweep, and store their results.

    Args:
        database: Database of the sweep.
        workers: Number of worker processes.
        cluster: Address of a dask scheduler, whose workers execute the runs, or None.
        side: `A` or `B` in a comparison, else "".
    """
    from executive.campaign.jobs import JobOptions, list_jobs
    from executive.campaign.sweep import run_sweep
    from executive.cli.progress import print_halt, show_progress

    mission, jobs = database.settings.mission, list_jobs(database.settings, database.path.parent)
    stored_indices = {run.run_index for run in database.read_runs()}
    missing_jobs = [job for job in jobs if job.index not in stored_indices]
    with show_progress(f"{side}: {mission}" if side else mission) as progress:
        run_sweep(missing_jobs, database, JobOptions(workers, progress, print_halt), cluster)
