"""The commands: what they print, where, and how they end."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from executive.cli.main import COMMANDS, main
from executive.errors import Fault, InputError
from executive.mission.findings import Finding, MissionError
from executive.mission.flow.endings import Ending

RESULT = {
    "mission": "sort",
    "status": "SUCCESS",
    "reason": "",
    "message": "",
    "node": "",
    "seed": 7,
    "items": {"seen": 1, "placed": 1, "rejected": 0, "lost": 0, "phantom": 0},
    "audit": {"right": 1, "wrong_bin": 0, "left": 0, "elsewhere": 0, "unseen": 0},
    "planning": {"motions": 3, "ahead": 2, "waited_s": 0.05},
    "requests": [],
    "story": None,
    "robot_time_s": 30.0,
    "wall_time_s": 6.0,
    "trace": "0123456789abcdef",
    "run": "runs/x",
}


@pytest.fixture
def project(monkeypatch):
    """Stands for everything below the commands; tests say what it answers and read what it was asked."""
    asked = SimpleNamespace(
        load=[], run=[], load_error=None, warnings=(), endings=(), run_error=None, result=dict(RESULT)
    )

    def load_mission(mission, skills, overrides=None, robot_check=None):
        asked.load.append((mission, overrides))
        if asked.load_error is not None:
            raise asked.load_error
        named = SimpleNamespace(name=mission)
        return SimpleNamespace(mission=named, warnings=asked.warnings, endings=asked.endings)

    def recorded_run(loaded, skills, **options):
        asked.run.append(options)
        os.write(1, b"noise from a library\n")
        if asked.run_error is not None:
            raise asked.run_error
        return asked.result

    monkeypatch.setattr("executive.mission.load.load_mission", load_mission)
    monkeypatch.setattr("executive.record.recorded_run.recorded_run", recorded_run)
    monkeypatch.setattr("executive.discovery.discover", dict)
    monkeypatch.setattr("executive.view.report.page.leave_report", lambda result: ("runs/x/report.html", ""))
    return asked


def invoke(*words: str):
    return CliRunner().invoke(main, words)


def test_sigterm_ends_a_command_with_a_word_as_ctrl_c_does(project, monkeypatch):
    before = signal.getsignal(signal.SIGTERM)
    # While it still loads what it needs, long before a run listens.
    monkeypatch.setattr("executive.discovery.discover", lambda: os.kill(os.getpid(), signal.SIGTERM))
    shown = invoke("run", "sort")
    assert (shown.exit_code, shown.stdout, shown.stderr) == (130, "", "\nhalted\n")
    assert signal.getsignal(signal.SIGTERM) is before


def test_sigterm_that_is_to_be_ignored_is_ignored(project, monkeypatch):
    before = signal.signal(signal.SIGTERM, signal.SIG_IGN)
    try:
        monkeypatch.setattr(
            "executive.discovery.discover", lambda: os.kill(os.getpid(), signal.SIGTERM) or {}
        )
        assert invoke("run", "sort").exit_code == 0
    finally:
        signal.signal(signal.SIGTERM, before)


def test_help_names_every_command_and_every_exit_code():
    shown = invoke("--help")
    assert shown.exit_code == 0
    assert all(f"  {command} " in shown.stdout for command in COMMANDS)
    assert "0 success, 1 mission failed, 2 bad input, 3 fault, 130 halted" in shown.stdout


def test_help_loads_nothing_heavy():
    code = (
        "import sys; from executive.cli.main import main\n"
        "try: main(['--help'])\nexcept SystemExit: print(*sys.modules)"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert "click" in loaded
    assert not {"numpy", "pydantic", "py_trees", "pybullet", "cv2", "rich", "yaml"} & set(loaded)


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_explains_itself(command):
    assert invoke(command, "--help").exit_code == 0


def test_a_misspelt_command_is_recognized():
    shown = invoke("chekc", "x")
    assert shown.exit_code == 2
    assert 'there is no command "chekc"; did you mean "check"?' in shown.stderr


@pytest.mark.parametrize(("status", "code"), [("SUCCESS", 0), ("FAILURE", 1), ("FAULT", 3), ("HALTED", 130)])
def test_a_run_ends_with_the_exit_code_of_its_outcome(project, status, code):
    project.result["status"] = status
    assert invoke("run", "sort", "--quiet").exit_code == code


def test_a_run_passes_on_everything_it_was_asked_for(project):
    invoke(
        "run", "sort", "--seed", "7", "--set", "a=1", "--set", "b=x=y", "--runs", "out", "--realtime",
        "--request", "cube", "--request", "duck",
    )  # fmt: skip
    assert project.load == [("sort", {"a": "1", "b": "x=y"})]
    (options,) = project.run
    assert (options["seed"], str(options["runs"]), options["gui"], options["realtime"]) == (
        7,
        "out",
        False,
        True,
    )
    assert options["requests"] == ("cube", "duck")
    assert options["views"]


def test_without_requests_the_operator_is_asked(project):
    invoke("run", "sort")
    assert project.run[0]["requests"] is None


def test_json_is_the_only_thing_on_standard_output(project, tmp_path):
    shown = invoke("run", "sort", "--json")
    assert json.loads(shown.stdout) == RESULT
    assert "repeat: executive run sort --seed 0" in shown.stderr


def test_quiet_is_silent(project):
    shown = invoke("run", "sort", "--quiet")
    assert shown.output == ""
    assert project.run[0]["views"] == []


def test_quiet_tells_the_story_of_a_run_that_does_not_succeed(missions, tmp_path):
    nothing = ("--set", "cell.kind=fake", "--set", "cell.table.objects=[0, 0]")
    mission = tmp_path / "look.yaml"
    shutil.copytree(missions / "cells", tmp_path / "cells")
    mission.write_text(
        "mission: look\ndescription: Look.\ncell: cells/overhead.yaml\n"
        "routes: {cube: red_bin}\ntree: [MoveToScan, Detect, Localize, SelectTarget]\n"
    )
    shown = invoke("run", str(mission), "--quiet", "--runs", str(tmp_path), *nothing)
    assert (shown.exit_code, shown.stdout) == (1, "")
    lines = shown.stderr.splitlines()
    assert lines[0].startswith("FAILURE after ")
    assert lines[-1].startswith(f"repeat      executive run {mission} ")


def test_what_libraries_print_does_not_reach_standard_output():
    code = """
import ctypes, os
from executive.cli.output import print_json, stdout_kept_clean
libc = ctypes.CDLL(None)
with stdout_kept_clean():
    os.write(1, b"unbuffered\\n")
    libc.puts(b"buffered by C")
    print("from Python")
print_json([1])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == [1]
    assert done.stderr == "from Python\n"


@pytest.mark.parametrize("override", ["novalue", "=1"])
def test_an_override_without_key_or_value_is_explained(project, override):
    shown = invoke("run", "sort", "--set", override)
    assert shown.exit_code == 2
    assert f'"{override}" is no override; write it as KEY=VALUE' in shown.stderr


def test_an_override_given_twice_is_refused(project):
    shown = invoke("run", "sort", "--set", "a=1", "--set", "a=2")
    assert shown.exit_code == 2
    assert '"a" is set twice' in shown.stderr


def test_bad_input_is_its_text_and_nothing_else(project):
    project.load_error = InputError('there is no mission "sort"')
    shown = invoke("run", "sort")
    assert (shown.exit_code, shown.stdout, shown.stderr) == (2, "", 'there is no mission "sort"\n')


def test_a_fault_outside_of_the_tree_ends_with_its_code(project):
    project.run_error = Fault("the simulator is gone")
    shown = invoke("run", "sort", "--quiet")
    assert (shown.exit_code, shown.stderr) == (3, "the simulator is gone\n")


def test_a_second_ctrl_c_ends_with_130(project):
    project.run_error = KeyboardInterrupt()
    assert invoke("run", "sort", "--quiet").exit_code == 130


def test_a_bug_is_one_sentence_that_says_where_the_details_are(project):
    project.run_error = ZeroDivisionError("division by zero")
    shown = invoke("run", "sort", "--quiet")
    assert shown.exit_code == 3
    assert "Traceback" not in shown.stderr
    assert "internal error (ZeroDivisionError: division by zero)" in shown.stderr
    path = shown.stderr.split("the details are in ")[1].split(",")[0]
    with open(path) as file:
        assert "Traceback" in file.read()
    os.remove(path)


def test_debug_shows_the_traceback(project):
    project.run_error = ZeroDivisionError("division by zero")
    shown = invoke("--debug", "run", "sort", "--quiet")
    assert shown.exit_code == 3
    assert "Traceback" in shown.stderr


def test_check_tells_every_finding(project):
    project.load_error = MissionError(
        [Finding("sort.yaml", 3, 5, "error", "unknown-skill", 'no skill "Grap"')]
    )
    shown = invoke("check", "sort.yaml")
    assert shown.exit_code == 2
    assert 'sort.yaml:3:5: error[unknown-skill]: no skill "Grap"' in shown.stdout


def test_check_as_json_is_one_array(project):
    project.load_error = MissionError([Finding("sort.yaml", 3, 5, "error", "unknown-skill", "no")])
    shown = invoke("check", "a.yaml", "b.yaml", "--json")
    reports = json.loads(shown.stdout)
    assert [report["mission"] for report in reports] == ["a.yaml", "b.yaml"]
    assert reports[0]["findings"][0]["line"] == 3
    assert shown.exit_code == 2


def test_check_says_that_all_is_well(project):
    shown = invoke("check", "sort")
    assert (shown.exit_code, shown.stdout) == (0, "sort: ok\n")


def test_check_tells_what_can_still_end_the_mission(project):
    project.endings = (
        Ending("Detect", "hidden", "tree/look/Detect", "sort.yaml", 9),
        Ending("Detect", "unsure", "tree/look/Detect", "sort.yaml", 9),
        Ending("Detect", "hidden", "tree/again/look/Detect", "sort.yaml", 9),
        Ending("Release", "stuck", "tree/Release", "sort.yaml", 12),
    )
    shown = invoke("check", "sort.yaml")
    assert shown.exit_code == 0
    assert shown.stdout.splitlines() == [
        "sort.yaml: ok",
        "  nothing deals with these failures; each would end the mission:",
        "    Detect: hidden, unsure  sort.yaml:9",
        "    Release: stuck          sort.yaml:12",
    ]
    (report,) = json.loads(invoke("check", "sort.yaml", "--json").stdout)
    assert report["endings"][3] == {
        "source": "Release", "reason": "stuck", "node": "tree/Release", "path": "sort.yaml", "line": 12,
    }  # fmt: skip


def test_a_warning_is_told_and_stops_nothing(project):
    project.warnings = (Finding("sort.yaml", 3, 5, "warning", "unused", "no skill reads it"),)
    shown = invoke("check", "sort.yaml")
    assert shown.exit_code == 0
    assert "sort.yaml:3:5: warning[unused]: no skill reads it" in shown.stdout
    shown = invoke("run", "sort.yaml")
    assert shown.exit_code == 0
    assert "warning[unused]" in shown.stderr


@pytest.mark.parametrize(("seeds", "words"), [("3-1", "holds no seed"), ("a-b", "is no range of seeds")])
def test_a_range_of_seeds_is_checked(project, seeds, words):
    shown = invoke("sweep", "sort", "--seeds", seeds)
    assert shown.exit_code == 2
    assert words in shown.stderr


@pytest.mark.parametrize(
    ("statuses", "code"), [(["SUCCESS"], 0), (["SUCCESS", "FAILURE"], 1), (["HALTED"], 130)]
)
def test_a_sweep_ends_by_its_worst_run(project, monkeypatch, tmp_path, statuses, code):
    results = [{**RESULT, "seed": seed, "status": status} for seed, status in enumerate(statuses)]
    monkeypatch.setattr("executive.campaign.sweep.sweep", lambda *args, **options: results)
    shown = invoke("sweep", "sort", "--seeds", f"0-{len(statuses) - 1}", "--json", "--runs", str(tmp_path))
    assert shown.exit_code == code
    assert json.loads(shown.stdout)["results"] == results


@pytest.mark.parametrize(
    ("statuses", "told"),
    [
        (["SUCCESS", "FAILURE"], "2 of 6 runs, cut off; 1 of them succeeded\n"),
        (["SUCCESS", "HALTED"], "1 of 6 runs, cut off; 1 of them succeeded\n"),
        ([], "0 of 6 runs, cut off\n"),
    ],
)
def test_a_sweep_that_was_cut_off_says_so(project, monkeypatch, tmp_path, statuses, told):
    results = [{**RESULT, "seed": seed, "status": status} for seed, status in enumerate(statuses)]
    monkeypatch.setattr("executive.campaign.sweep.sweep", lambda *args, **options: results)
    shown = invoke("sweep", "sort", "--seeds", "0-5", "--json", "--runs", str(tmp_path))
    assert shown.exit_code == 130
    assert told in shown.stderr
    figures = json.loads(shown.stdout)
    assert (figures["asked"], figures["cut_off"]) == (6, True)


def test_a_sweep_into_a_place_that_takes_nothing_is_bad_input(project, monkeypatch, tmp_path):
    (tmp_path / "file").touch()
    monkeypatch.setattr("executive.campaign.sweep.sweep", lambda *args, **options: pytest.fail("it began"))
    shown = invoke("sweep", "sort", "--seeds", "0-9", "--runs", str(tmp_path / "file" / "runs"))
    assert shown.exit_code == 2
    assert shown.stderr == (
        f'cannot make a run directory below "{tmp_path}/file/runs": not a directory; '
        "name another place with --runs DIR\n"
    )


def test_a_run_without_a_directory_is_told_without_one(project, monkeypatch, tmp_path):
    broken = {**RESULT, "status": "FAULT", "reason": "fault", "message": "it broke", "run": ""}
    monkeypatch.setattr("executive.campaign.sweep.sweep", lambda *args, **options: [broken, RESULT])
    shown = invoke("sweep", "sort", "--seeds", "7-8", "--runs", str(tmp_path))
    assert "1 runs did not succeed:\n  seed 7: FAULT: it broke\n" in shown.stderr


def test_an_unknown_cell_is_recognized():
    shown = invoke("dataset", "overhed", "--out", "x")
    assert shown.exit_code == 2
    assert 'Did you mean "overhead"?' in shown.stderr


def test_a_window_without_a_display_is_bad_input(project, monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    shown = invoke("run", "sort", "--gui")
    assert shown.exit_code == 2
    assert "--gui needs a display, and DISPLAY names none; leave it out" in shown.stderr
    assert project.run == []


def test_a_run_that_nobody_could_let_go_on_is_refused(project):
    shown = invoke("run", "sort", "--paused")
    assert shown.exit_code == 2
    assert "nobody could let it go on: --paused needs --view or a terminal to type in" in shown.output
