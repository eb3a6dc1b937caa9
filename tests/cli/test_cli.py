"""The commands: what they print, where, and how they end."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest
from at_terminal import invoke

import executive.campaign.sweep  # noqa: F401 - imported before `load_mission` is replaced
from executive.cell.json_values import to_json
from executive.errors import Fault, InputError
from executive.mission.analysis import UnhandledFailure
from executive.record.result import Audit, ItemCounts, Result
from executive.record.timeline import PlanningTotals
from executive.run.assembly import RunOptions
from executive.text.findings import Finding

RESULT = Result(
    mission="sort", status="SUCCESS", reason="", message="", node="", seed=7,
    items=ItemCounts(seen=1, placed=1), audit=Audit(right=1), planning=PlanningTotals(3, 2, 0.05),
    robot_time_s=30.0, wall_time_s=6.0, trace="0123456789abcdef", run="runs/x",
)  # fmt: skip


@pytest.fixture
def project(monkeypatch):
    """Stands for everything below the commands; tests say what it answers and read what it was asked."""
    asked = SimpleNamespace(
        load=[], run=[], load_error=None, warnings=(), endings=(), run_error=None, result=RESULT
    )

    def load_mission(mission, skills, overrides=None, robot_check=None, cell=""):
        asked.load.append((mission, overrides))
        if asked.load_error is not None:
            raise asked.load_error
        named = SimpleNamespace(name=mission)
        return SimpleNamespace(mission=named, warnings=asked.warnings, unhandled_failures=asked.endings)

    def record_run(loaded, options, runs, record):
        asked.run.append((options, runs, record))
        os.write(1, b"noise from a library\n")
        if asked.run_error is not None:
            raise asked.run_error
        return asked.result

    monkeypatch.setattr("executive.mission.load.load_mission", load_mission)
    monkeypatch.setattr("executive.record.recorded_run.record_run", record_run)
    monkeypatch.setattr("executive.behaviours.load_skills", dict)
    monkeypatch.setattr("executive.view.report.try_write_report", lambda run: ("runs/x/report.html", ""))
    return asked


def test_sigterm_ends_a_command_with_a_word_as_ctrl_c_does(project, monkeypatch):
    before = signal.getsignal(signal.SIGTERM)
    # While it still loads what it needs, long before a run listens.
    monkeypatch.setattr("executive.behaviours.load_skills", lambda: os.kill(os.getpid(), signal.SIGTERM))
    shown = invoke("run", "sort")
    assert (shown.exit_code, shown.stdout, shown.stderr) == (130, "", "\nhalted\n")
    assert signal.getsignal(signal.SIGTERM) is before


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


def test_quiet_shows_a_run_with_rejected_objects_and_one_that_the_audit_contradicts(project):
    message = "1 object(s) were not sorted: cube-1 (could not be picked)"
    project.result = replace(RESULT, status="INCOMPLETE", reason="rejected", message=message)
    shown = invoke("run", "sort", "--quiet")
    assert (shown.exit_code, shown.stderr.splitlines()[-1]) == (4, f"INCOMPLETE rejected: {message}")
    wrong = Audit(agrees=False, wrong_bin=1)
    project.result = replace(RESULT, audit=wrong)
    shown = invoke("run", "sort", "--quiet")
    assert shown.exit_code == 1
    assert shown.stderr.splitlines()[-2].startswith("THE AUDIT DISAGREES: 1 in a wrong bin; ")


def test_what_libraries_print_does_not_reach_standard_output():
    code = """
import ctypes, os
from executive.cli.shared import print_json, keep_stdout_clean
libc = ctypes.CDLL(None)
with keep_stdout_clean():
    os.write(1, b"unbuffered\\n")
    libc.puts(b"buffered by C")
    print("from Python")
print_json([1])
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == [1]
    assert done.stderr == "from Python\n"


def test_json_stays_valid_where_the_terminal_knows_no_other_characters():
    code = "from executive.cli.shared import print_json; print_json(['ärm 手'])"
    environment = {**os.environ, "PYTHONIOENCODING": "ascii"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, env=environment, check=True)
    assert json.loads(done.stdout.decode("ascii")) == ["ärm 手"]


def test_check_tells_what_can_still_end_the_mission(project):
    project.endings = (
        UnhandledFailure("Detect", "hidden", "tree/look/Detect", "sort.yaml", 9),
        UnhandledFailure("Detect", "unsure", "tree/look/Detect", "sort.yaml", 9),
        UnhandledFailure("Detect", "hidden", "tree/again/look/Detect", "sort.yaml", 9),
        UnhandledFailure("Release", "stuck", "tree/Release", "sort.yaml", 12),
    )
    shown = invoke("check", "sort.yaml")
    assert shown.exit_code == 0
    assert shown.stdout.splitlines() == [
        "sort.yaml: ok",
        "  no node handles these failures; each would end the mission:",
        "    Detect: hidden, unsure  sort.yaml:9",
        "    Release: stuck          sort.yaml:12",
    ]
    (report,) = json.loads(invoke("check", "sort.yaml", "--json").stdout)
    assert report["endings"][3] == {
        "source": "Release", "reason": "stuck", "node": "tree/Release", "path": "sort.yaml", "line": 12,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        ("chekc x", 'there is no command "chekc"; did you mean "check"?'),
        ("run sort --set novalue", '"novalue" is not of the form KEY=VALUE'),
        ("run sort --set a=1 --set a=2", '"a" is set twice'),
        ("run sort --gui", "--gui needs a display, but DISPLAY is not set; omit --gui"),
        ("run sort --paused", "--paused needs --view or a keyboard"),
        ("sweep sort --seeds 3-1", '"3-1" contains no seed: 1 is less than 3'),
        ("sweep sort", "give a MISSION and --seeds, or --resume SWEEP"),
        ("sweep --resume x --set a=1", "--resume takes mission, seeds and settings from the sweep"),
        ("sweep sort --seeds 3 --set a=1 --vary a=[1]", "a is set with --set and also with --vary"),
        ("sweep sort --seeds 3 --vary a=1", '"a=1" is not of the form KEY=[VALUE, ...]'),
        (f"sweep sort --seeds {2**32}", "is too large; the maximum is 4294967295"),
        ("dataset overhed --out x", 'Did you mean "overhead"?'),
    ],
)
def test_what_cannot_be_meant_is_refused(project, monkeypatch, words, sentence):
    monkeypatch.delenv("DISPLAY", raising=False)
    shown = invoke(*words.split())
    assert (shown.exit_code, shown.stdout, project.run) == (2, "", [])
    assert sentence in shown.stderr


@pytest.mark.parametrize(
    ("error", "code", "said"),
    [
        (InputError('there is no mission "sort"'), 2, 'there is no mission "sort"\n'),
        (Fault("the simulator is gone"), 3, "the simulator is gone\n"),
        (KeyboardInterrupt(), 130, "halted\n"),
        (OSError(36, "File name too long", "x"), 2, "x: File name too long\n"),
    ],
)
def test_what_ends_a_run_is_its_text_and_nothing_else(project, error, code, said):
    project.run_error = error
    shown = invoke("run", "sort", "--quiet")
    assert (shown.exit_code, shown.stdout, shown.stderr.lstrip("\n")) == (code, "", said)


@pytest.mark.parametrize(
    ("error", "text"),
    [(ZeroDivisionError("by zero"), "ZeroDivisionError: by zero"), (SystemExit(0), "SystemExit: 0")],
)
def test_a_bug_is_one_sentence_that_says_where_the_details_are(project, error, text):
    project.run_error = error
    shown = invoke("run", "sort", "--quiet")
    assert (shown.exit_code, "Traceback" in shown.stderr) == (3, False)
    assert f"internal error ({text})" in shown.stderr
    path = Path(shown.stderr.split("; ")[1].split(" contains the traceback")[0])
    assert "Traceback" in path.read_text()
    path.unlink()
    debugged = invoke("--debug", "run", "sort", "--quiet")
    assert (debugged.exit_code, "Traceback" in debugged.stderr) == (3, True)


@pytest.mark.parametrize(("status", "code"), [("SUCCESS", 0), ("FAILURE", 1), ("FAULT", 3), ("HALTED", 130)])
def test_a_run_ends_with_the_exit_code_of_its_outcome(project, status, code):
    project.result = replace(RESULT, status=status)
    shown = invoke("run", "sort", "--quiet")
    assert (shown.exit_code, shown.output, project.run[0][2].views) == (code, "", [])


def test_a_run_passes_on_everything_it_was_asked_for(project):
    words = "run sort --seed 7 --set a=1 --set b=x=y --runs out --realtime --request cube --request duck"
    shown = invoke(*words.split(), "--json")
    assert project.load == [("sort", {"a": "1", "b": "x=y"})]
    ((options, runs, record),) = project.run
    assert options == RunOptions(7, ("cube", "duck"), is_realtime=True)
    assert (runs, record.starts_paused, len(record.views)) == (Path("out"), False, 1)
    assert json.loads(shown.stdout) == to_json(RESULT), "nothing else is on standard output"
    assert "repeat: executive run sort --seed 7" in shown.stderr
    invoke("run", "sort")
    assert project.run[1][0].requests is None, "the operator is asked"


def test_a_warning_is_printed_and_the_run_continues(project):
    shown = invoke("check", "sort")
    assert (shown.exit_code, shown.stdout) == (0, "sort: ok\n")
    project.warnings = (Finding("sort.yaml", 3, 5, "warning", "unused", "no skill reads it"),)
    checked, ran = invoke("check", "sort.yaml"), invoke("run", "sort.yaml")
    assert (checked.exit_code, ran.exit_code) == (0, 0)
    assert "sort.yaml:3:5: warning[unused]: no skill reads it" in checked.stdout
    assert "warning[unused]" in ran.stderr
