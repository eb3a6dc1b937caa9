"""Commands of one run: `run`, `replay` and `report`."""

from __future__ import annotations

import contextlib
import os
import sys
from pathlib import Path

import click

from executive.cli import shared
from executive.errors import ExitCode


@click.command(name="run")
@click.argument("mission", metavar="MISSION", required=False)
@click.option("--resume", metavar="RUN", help="Resume an interrupted run: a run directory or `latest`.")
@shared.seed_option
@shared.overrides_option
@shared.cell_option
@shared.scene_option
@shared.video_option
@shared.force_option
@shared.runs_option
@shared.json_option
@click.option("--quiet", is_flag=True, help="Print only the cause if the run does not succeed.")
@click.option("--view", "has_page", is_flag=True, help="Show the run on a web page, and print its address.")
@click.option("--paused", is_flag=True, help="Wait for the operator before the first control step.")
@click.option("--gui", is_flag=True, help="Open the simulator's window.")
@click.option("--realtime", is_flag=True, help="Run in real time instead of as fast as possible.")
@click.option(
    "--request", "requests", metavar="CLASS", multiple=True,
    help="Class that the operator requests; repeat the option for further requests, in their order.",
)  # fmt: skip
@click.pass_context
def run_command(
    ctx: click.Context, mission: str | None, resume: str | None, seed: int, overrides: dict[str, str],
    cell: str, scene: Path | None, video: Path | None, force: bool, runs_folder: Path, as_json: bool,
    quiet: bool, has_page: bool, paused: bool, gui: bool, realtime: bool, requests: tuple[str, ...],
) -> ExitCode:  # fmt: skip
    """Run a mission and record the run.

    MISSION is a file or the name of a shipped mission.
    """
    has_mission_options = shared.is_any_given(
        ctx, "mission", "seed", "overrides", "requests", "cell", "scene"
    )
    has_keyboard = sys.stdin is not None and sys.stdin.isatty()
    settings_text = "mission, seed, params, requests, cell and scene from the run"
    pauses_forever = paused and not has_page and (quiet or not has_keyboard)
    shared.check_usage(
        (mission is None and resume is None, "give a MISSION, or a run with --resume RUN"),
        (resume is not None and has_mission_options, f"--resume takes {settings_text}; omit them"),
        (pauses_forever, "--paused needs --view or a keyboard in a terminal to continue the run"),
        # The simulator would end the process if it could not open its window.
        (gui and not os.environ.get("DISPLAY"), "--gui needs a display, but DISPLAY is not set; omit --gui"),
    )
    with shared.keep_stdout_clean():
        # The imports take half a second, for which `--help` and wrong options must not wait.
        from rich.console import Console

        from executive.behaviours import load_skills
        from executive.cell.json_values import to_json
        from executive.mission.load import load_mission
        from executive.record.journal import find_run_start, read_journal
        from executive.record.recorded_run import GuardedView, RecordOptions, record_run
        from executive.record.result import find_exit_code, format_diagnosis
        from executive.record.run_directory import find_recorded_options, find_run, read_cell
        from executive.run.assembly import RunOptions
        from executive.station.check import load_checker
        from executive.view import terminal
        from executive.view.report import try_write_report

        console = Console(file=shared.open_unescaped_stderr())
        is_redrawn = sys.stderr.isatty() and console.is_terminal and not console.is_dumb_terminal
        terminal_view: terminal.TerminalView | terminal.LineView | None = None
        if is_redrawn and not quiet:
            terminal_view = terminal.TerminalView(console, sys.stdin.fileno() if has_keyboard else None)
        elif not quiet:
            terminal_view = terminal.LineView(sys.stderr)
        with contextlib.ExitStack() as exit_stack:
            page = None
            if has_page:
                # Only a page needs the web server.
                from executive.view.live_page import LivePage

                page = LivePage()
                exit_stack.callback(page.finish)
                click.echo(f"watch the run at {page.address}", err=True)
            views = [GuardedView(view) for view in (terminal_view, page) if view is not None]
            record = RecordOptions(views, starts_paused=paused)
            driver_options = {"scene": str(scene)} if scene else {}
            driver_options |= {"gui": "true"} if gui else {}
            run_options = RunOptions(
                seed, requests or None, has_keyboard=page is None or has_keyboard,
                is_realtime=realtime, driver_options=driver_options,
            )  # fmt: skip
            if mission is None:
                # Only a resumption needs the replay.
                from executive.record.replayed_run import resume_run

                assert resume is not None
                path = find_run(resume, runs_folder)
                if video is not None:
                    shared.check_video(video, read_cell(path).kind, force=force)
                result = resume_run(path, load_skills(), run_options, record)
                events = read_journal(path / "journal.jsonl")
                start_event = find_run_start(events, path, "run the mission again")
                repeat_arguments = (start_event.file, start_event.seed, start_event.overrides)
                cell = start_event.cell
            else:
                loaded_mission = load_mission(mission, load_skills(), overrides, load_checker, cell)
                for warning in loaded_mission.warnings if views else ():
                    click.echo(str(warning), err=True)
                if video is not None:
                    shared.check_video(video, loaded_mission.cell_config.kind, force=force)
                result = record_run(loaded_mission, run_options, runs_folder, record)
                repeat_arguments = (mission, seed, overrides)
            # The command that repeats the run also contains requests that the operator made during the run.
            repeat_options = {"cell": cell, **find_recorded_options(Path(result.run))}
            repeat_command = terminal.format_repeat_command(
                *repeat_arguments, requests or result.requests, repeat_options
            )
            report, report_problem = try_write_report(result.run)
            if page is not None:
                page.finish(result, report and str(Path(report).resolve()))
        page_problem = "" if page is None else page.problem
        problems = filter(None, (report_problem, page_problem, *(view.problem for view in views)))
        if (note := "; ".join(problems)) and (views or result.diagnosis is not None):
            click.echo(f"note: {note}", err=True)
        if terminal_view is not None:
            items = terminal_view.timeline.items.changes.values()
            click.echo(terminal.format_summary(result, items, repeat_command, report), err=True, nl=False)
        elif result.diagnosis is not None:
            lines = format_diagnosis(result.diagnosis, result.run, repeat_command, report)
            click.echo("\n".join(lines), err=True)
        elif result.status == "INCOMPLETE" or result.disagreement:
            end_description = terminal.describe_end(result.status, result.reason, result.node, result.message)
            click.echo("\n".join(filter(None, (result.disagreement, end_description))), err=True)
    if as_json:
        shared.print_json(to_json(result))
    if video is not None:
        with shared.keep_stdout_clean():
            # The import takes 0.1 s, and only a video needs it.
            from executive.view.video import write_video

            write_video(Path(result.run), video)
            click.echo(f"video: {video}", err=True)
    return find_exit_code(result)


@click.command(name="replay")
@click.argument("run", metavar="RUN")
@click.option(
    "--mission", "mission_file", type=shared.FILE, help="Mission file instead of the recorded mission."
)
@shared.video_option
@shared.force_option
@shared.runs_option
@shared.json_option
def replay_command(
    run: str, mission_file: Path | None, video: Path | None, force: bool, runs_folder: Path, as_json: bool
) -> ExitCode:
    """Repeat the decisions of a recorded run.

    RUN is a run directory or `latest`. Nothing moves and nothing is simulated: tree, skills and ledger get
    the recorded inputs from arm, tool, camera, detectors and operator. Exit code 1 if a decision differs
    from the record; the first difference is printed. With --video, the world of the run is simulated again,
    also after a halt or an interruption.
    """
    with shared.keep_stdout_clean():
        # The imports take half a second, for which `--help` and wrong options must not wait.
        from executive.behaviours import load_skills
        from executive.record.journal import read_journal
        from executive.record.replayed_run import replay_run
        from executive.record.run_directory import find_run, read_cell

        path = find_run(run, runs_folder)
        if video is not None:
            # The import takes 0.1 s, and only a video needs it.
            from executive.view.video import write_video

            shared.check_video(video, read_cell(path).kind, force=force)
            write_video(path, video)
            click.echo(f"video: {video}", err=True)
        result = replay_run(path, read_journal(path / "journal.jsonl"), load_skills(), mission_file)
        comparison = ", all as recorded" if result.is_equal else f" as recorded, then {result.difference}"
        click.echo(f"{result.decisions} decisions{comparison} ({path})", err=True)
    if as_json:
        shared.print_json({"run": str(path), "same": result.is_equal, **result.as_json()})
    return ExitCode.SUCCESS if result.is_equal else ExitCode.FAILURE


@click.command(name="report")
@click.argument("run", metavar="RUN")
@shared.runs_option
@shared.json_option
def report_command(run: str, runs_folder: Path, as_json: bool) -> None:
    """Write the report of a recorded run.

    RUN is a run directory or `latest`. Prints the path of the report. Every run writes its report when it
    ends; this command writes the report again, or for the first time if the run was killed.
    """
    with shared.keep_stdout_clean():
        # The imports take half a second, for which `--help` must not wait.
        from executive.record.run_directory import find_run
        from executive.view.report import write_report

        file = write_report(find_run(run, runs_folder))
    shared.print_result({"report": str(file), "bytes": file.stat().st_size}, str(file), as_json=as_json)
