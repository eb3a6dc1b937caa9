"""`executive compare`: run two missions with the same seeds, and estimate the differences."""

from __future__ import annotations

from contextlib import closing
from pathlib import Path

import click

from executive.cli import options
from executive.cli.streams import keep_stdout_clean, print_json
from executive.cli.sweep import execute_missing_runs
from executive.exit_codes import ExitCode


@click.command(name="compare")
@click.argument("missions", metavar="A [B]", nargs=-1)
@options.make_overrides_option("--set-a", "overrides_a", help="Like --set, but only for A; repeatable.")
@options.make_overrides_option("--set-b", "overrides_b", help="Like --set, but only for B; repeatable.")
@click.option(
    "--resume", type=options.FOLDER, metavar="FOLDER",
    help="Execute the missing runs of the interrupted comparison in this folder.",
)  # fmt: skip
@options.add_sweep_options
@click.pass_context
def command(
    ctx: click.Context, missions: tuple[str, ...], seeds: range | None, overrides_a: dict[str, str],
    overrides_b: dict[str, str], resume: Path | None, workers: int, cluster: str | None, frames: bool,
    overrides: dict[str, str], scene: Path | None, runs: Path, as_json: bool,
) -> int:  # fmt: skip
    """Run the missions A and B once for every seed, and estimate the differences.

    A and B are files or names of shipped missions. A single mission is used as A and as
    B, and --set-a and --set-b state the difference. The results of both are stored in a/results.sqlite and
    b/results.sqlite in a folder below --runs. Each difference has a 95 % confidence interval.
    Ctrl-C ends the current runs; then the results of the complete pairs are printed.
    """
    options.check_resume(
        ctx, has_runs=len(missions) in (1, 2) and seeds is not None,
        runs_text="one or two missions and --seeds, or --resume FOLDER",
        settings_text="missions, seeds and settings from the comparison",
    )  # fmt: skip
    options.check_distinct("--set and --set-a or --set-b", overrides, {**overrides_a, **overrides_b})
    with keep_stdout_clean():
        from executive.campaign.results.differences import compute_differences, pair_runs
        from executive.campaign.results.results_page import write_missing_reports, write_page
        from executive.campaign.results.sweep_folder import create_comparison, make_settings, open_comparison
        from executive.campaign.results.sweep_summary import SweepResults
        from executive.cell.json_values import to_json
        from executive.cli.progress import print_report
        from executive.cli.sweep_tables import list_differences

        if resume is not None:
            databases = open_comparison(resume)
        else:
            assert seeds is not None
            settings = [
                make_settings(mission, seeds, {**overrides, **own_overrides}, {}, scene, frames)
                for mission, own_overrides in ((missions[0], overrides_a), (missions[-1], overrides_b))
            ]
            databases = create_comparison(settings, runs)
        sweeps: list[SweepResults] = []
        for name, database in zip("AB", databases, strict=True):
            is_halted = any(sweep.is_incomplete for sweep in sweeps)
            with closing(database):
                sweeps.append(execute_missing_runs(database, name, workers, cluster, is_halted=is_halted))
        pairs = pair_runs(sweeps[0].runs, sweeps[1].runs)
        differences, changed = compute_differences(pairs), [pair for pair in pairs if pair.is_changed]
        write_missing_reports(changed)
        page = write_page(databases[0].path.parents[1], sweeps, differences, changed)
        print_report(list_differences(differences, changed, len(pairs)))
        click.echo(f"page: {page}", err=True)
    if as_json:
        print_json(to_json({
            "settings": [sweep.settings for sweep in sweeps],
            "results": [str(database.path) for database in databases], "page": str(page),
            "pairs": len(pairs), "differences": differences, "changed": changed,
            "summaries": [summary for sweep in sweeps for summary in sweep.summaries],
        }))  # fmt: skip
    return ExitCode.HALTED if any(sweep.is_incomplete for sweep in sweeps) else ExitCode.SUCCESS
