"""`executive sweep`: run a mission for many seeds, and summarize the results."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import click

from executive.cli import options
from executive.cli.streams import print_json, stdout_kept_clean


def parse_seed_range(text: str) -> range:
    """Return the seeds from A to B (both included) for `A-B`, or the single seed for `A`."""
    match = re.fullmatch(r"(\d{1,10})(?:-(\d{1,10}))?", text)
    if match is None:
        raise click.BadParameter(f'"{text}" is no range of seeds; write it as 0-99')
    first, last = int(match[1]), int(match[2] or match[1])
    if last < first:
        raise click.BadParameter(f'"{text}" holds no seed: {last} is less than {first}')
    if last > options.MAX_SEED:
        raise click.BadParameter(f'"{text}" holds the seed {last}; the largest seed is {options.MAX_SEED}')
    return range(first, last + 1)


@click.command(name="sweep")
@options.MISSION
@click.option(
    "--seeds", type=parse_seed_range, metavar="A-B", required=True,
    help="First and last seed, for instance 0-99.",
)  # fmt: skip
@options.workers_option
@click.option("--frames", is_flag=True, help="Save the images on which the decisions are based.")
@options.overrides_option
@options.scene_option
@options.runs_option
@options.json_option
@click.pass_context
def command(
    ctx: click.Context, mission: str, seeds: range, workers: int, frames: bool, overrides: dict[str, str],
    scene: Path | None, runs: Path, as_json: bool,
) -> None:  # fmt: skip
    """Run MISSION once for every seed; exit code 1 if any run did not succeed.

    Ctrl-C halts the current runs; the results of the complete runs are printed. A second Ctrl-C ends at once.
    """
    with stdout_kept_clean():
        from executive.campaign.sweep import Job, run_sweep, summarize_results
        from executive.cell.json_values import to_json
        from executive.cli.progress import bar, print_halting
        from executive.mission.load import load_mission
        from executive.plugins import discover, load_cell_kind
        from executive.record.run_directory import check_runs_folder

        # A mistake in the mission or the folder is reported once, not for every seed.
        loaded = load_mission(mission, discover(), overrides, load_cell_kind)
        if scene is not None:
            from executive.cells.sim.scene_file import load_scene

            load_scene(scene, loaded.cell_config)
        check_runs_folder(runs)
        with bar(mission) as progress:
            jobs = [Job(mission, seed, overrides, runs, frames, scene) for seed in seeds]
            results = run_sweep(jobs, workers=workers, progress=progress, on_halt=print_halting)
        figures = summarize_results(results, len(seeds))
        click.echo(_describe(figures), err=True)
    if as_json:
        settings = {"mission": mission, "seeds": [seeds[0], seeds[-1]], "scene": scene and str(scene)}
        print_json({**settings, **figures, "results": to_json(results)})
    has_problem = figures["succeeded"] < figures["runs"] or bool(figures["disagreements"])
    ctx.exit(130 if figures["cut_off"] else int(has_problem))


def _describe(figures: dict[str, Any]) -> str:
    """Return the figures of a sweep as lines of text."""
    from executive.view.terminal.summary import describe_end

    done, succeeded = figures["runs"], figures["succeeded"]
    headline = f"{succeeded} of {done} runs succeeded"
    if figures["cut_off"]:
        headline = f"{done} of {figures['asked']} runs, cut off" + (
            f"; {succeeded} of them succeeded" if done else ""
        )
    if not done:
        return headline
    objects, robot, wall = figures["objects"], figures["robot_time_s"], figures["wall_time_s"]
    low, high = objects["interval_95"]
    lines = [
        headline,
        f"{objects['right']} of {objects['total']} objects right: {objects['share']:.2%} "
        f"(95 % interval {low:.2%} to {high:.2%})",
        f"robot time {robot['median']:.1f} s (median; {robot['least']:.1f} to {robot['most']:.1f}), "
        f"wall time {wall['median']:.1f} s ({wall['least']:.1f} to {wall['most']:.1f})",
    ]
    planning, pace = figures["planning"], figures["robot_time_per_object_s"]
    if pace and planning["motions"]:
        ahead = (
            f"{planning['ahead'] / planning['motions']:.0%} of {planning['motions']} motions planned ahead"
        )
        waited = f"{planning['waited_s']:.1f} s waited for the others"
        lines.append(f"robot time per object {pace:.2f} s; {ahead}, {waited}")
    lines.append(f"ledger and audit disagree in {len(figures['disagreements'])} runs")
    for entry in figures["disagreements"]:
        items, audit = (
            ", ".join(f"{name} {number}" for name, number in entry[key].items()) for key in ("items", "audit")
        )
        lines.append(f"  seed {entry['seed']}: the ledger says {items}; the audit {audit}; {entry['run']}")
    if figures["failures"]:
        lines.append(f"{len(figures['failures'])} runs did not succeed:")
    keys = ("status", "reason", "node", "message")
    for entry in figures["failures"]:
        # A run whose process crashed, or that could not create its directory, has no directory.
        where = entry["run"] and f"; {entry['run']}"
        lines.append(f"  seed {entry['seed']}: {describe_end(*map(entry.get, keys))}{where}")
    return "\n".join(lines)
