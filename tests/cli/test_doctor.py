"""What `executive doctor` says of an installation, each sentence of it, whatever this one is like."""

from __future__ import annotations

import http.server
import json
import socket
import subprocess
import sys
import threading
from collections.abc import Iterable, Iterator
from pathlib import Path

import pytest
from click.testing import CliRunner, Result

from executive.cli import doctor
from executive.cli.doctor.display import display
from executive.cli.doctor.finding import Finding
from executive.cli.doctor.opencv import opencv
from executive.cli.doctor.packages import extras, packages
from executive.cli.doctor.python import python
from executive.cli.doctor.registered import loaded, registered
from executive.cli.doctor.renderer import Drawing, drawn, renderer, understood
from executive.cli.doctor.roboflow import answers_in_time, key, server
from executive.cli.main import main
from executive.errors import InputError
from executive.project import Project

INSTALLED = {
    "executive": "1.0", "pybullet": "3.2", "av": "14.0", "viser": "1.1", "aiohttp": "3.11",
    "opencv-python-headless": "4.12",
}  # fmt: skip
NEEDED = {"": ("pybullet", "av"), "view": ("viser", "aiohttp"), "train": ("torch", "onnx")}


def told(findings: Iterable[Finding]) -> list[str]:
    return [f"{finding.mark} {finding.subject}: {finding}" for finding in findings]


def without(*names: str):
    return lambda name: "" if name in names else INSTALLED.get(name, "")


@pytest.mark.parametrize("version", [(3, 10, 0), (3, 11, 7)])
def test_a_python_that_can(version: tuple[int, ...]) -> None:
    (finding,) = python(version)
    assert (finding.mark, finding.told.split(" on ")[0]) == ("ok", ".".join(map(str, version)))


@pytest.mark.parametrize("version", [(3, 9, 1), (3, 12, 0)])
def test_a_python_that_cannot(version: tuple[int, ...]) -> None:
    (finding,) = python(version)
    assert finding.mark == "problem"
    assert str(finding).endswith(" has no pybullet wheel; use 3.10 or 3.11 (uv takes 3.11 by itself)")


def test_packages_that_are_there() -> None:
    assert told(packages(without(), NEEDED.get)) == ["ok packages: executive 1.0 and the 2 that it needs"]


def test_packages_that_are_missing() -> None:
    assert told(packages(without("av", "pybullet"), NEEDED.get)) == [
        "problem packages: pybullet is missing; run `uv sync`",
        "problem packages: av is missing; run `uv sync`",
    ]


def test_a_project_that_is_not_installed() -> None:
    assert told(packages(without("executive"), NEEDED.get)) == [
        "problem packages: executive itself is not installed; run `uv sync` in its folder"
    ]


def test_extras_and_films() -> None:
    assert told(extras(without("aiohttp"), NEEDED.get)) == [
        "note view: not installed: aiohttp; to watch a run in the browser, run `uv sync --extra view`",
        "note train: not installed: torch, onnx; to train a detector of your own, "
        "run `uv sync --extra train`",
        "ok film: av 14.0 writes films; the program ffmpeg is not needed",
    ]
    assert told(extras(without("av"), NEEDED.get))[0] == "ok view: viser 1.1, aiohttp 3.11"
    assert len(told(extras(without("av"), NEEDED.get))) == 2


def test_one_opencv_or_several() -> None:
    assert told(opencv(without())) == ["ok opencv: opencv-python-headless 4.12 alone brings a `cv2`"]
    both = {"opencv-python": "5.0", **INSTALLED}
    assert told(opencv(lambda name: both.get(name, ""))) == [
        "problem opencv: 2 packages bring a `cv2` and overwrite each other (opencv-python 5.0, "
        "opencv-python-headless 4.12); run `uv sync --reinstall`, which leaves opencv-python-headless alone"
    ]
    assert told(opencv(without("opencv-python-headless"))) == []


def test_what_is_registered() -> None:
    here = Project(Path("hall/pyproject.toml"), "hall", {})
    assert told(registered(lambda: {"skills": 15, "kinds of cells": 2}, lambda: here)) == [
        "ok registered: 15 skills, 2 kinds of cells; hall/pyproject.toml counts"
    ]
    assert told(registered(lambda: {"skills": 14}, lambda: None)) == ["ok registered: 14 skills"]


def test_what_is_registered_wrongly() -> None:
    def broken() -> dict[str, int]:
        raise InputError("the skill is broken; mend it")

    assert told(registered(broken)) == ["problem registered: the skill is broken; mend it"]


def test_all_sorts_that_are_registered_are_loaded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert {"skills", "kinds of cells", "kinds of detectors"} == set(loaded())
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    for group in ("cells", "detectors"):
        entry = f'[project.entry-points."executive.{group}"]\nbench = "not_there:Bench"\n'
        Path("pyproject.toml").write_text(entry)
        with pytest.raises(InputError, match=r'"bench" \(not_there:Bench\) cannot be loaded: ModuleNotF'):
            loaded()


def test_both_ways_to_draw() -> None:
    ways = {"tiny": Drawing(41.7), "egl": Drawing(9.1)}
    assert told(renderer(ways.__getitem__)) == [
        "ok renderer: TinyRenderer, on the processor: 42 ms for 640x480 of the overhead cell",
        "ok egl: PyBullet's EGL plugin can be loaded and draws; no cell needs it",
    ]


def test_neither_way_to_draw() -> None:
    ways = {"tiny": Drawing(None, "no frame came in 30 s"), "egl": Drawing(None, "it cannot be loaded")}
    assert told(renderer(ways.__getitem__)) == [
        "problem renderer: TinyRenderer draws nothing: no frame came in 30 s; "
        "run `uv sync --reinstall-package pybullet`",
        "note egl: PyBullet's EGL plugin draws nothing: it cannot be loaded; no cell needs it",
    ]


def test_what_a_driver_prints_around_a_figure_does_not_matter() -> None:
    assert understood(0, 'GL=Mesa\n{"milliseconds": 12.5}\nDestroy\n', "") == Drawing(12.5)
    # One that crashes only while it is taken down has drawn.
    assert understood(-11, '{"milliseconds": 12.5}\n', "") == Drawing(12.5)


@pytest.mark.parametrize(
    ("code", "complained", "why"),
    [
        (-11, "", "its process was ended by SIGSEGV"),
        (
            1,
            "starting\nError: it cannot be loaded\n\n",
            "its process ended with 1: Error: it cannot be loaded",
        ),
        (127, "", "its process ended with 127: it says nothing"),
    ],
)
def test_a_process_that_draws_nothing_says_why(code: int, complained: str, why: str) -> None:
    assert understood(code, "GL=Mesa\n", complained) == Drawing(None, why)


def test_a_frame_is_really_drawn_in_a_process_of_its_own() -> None:
    taken = drawn("tiny").milliseconds
    assert taken is not None and taken > 1


def test_a_process_that_never_comes_to_an_end(monkeypatch: pytest.MonkeyPatch) -> None:
    def hanging(*words: object, **options: object) -> None:
        raise subprocess.TimeoutExpired("python", 30.0)

    monkeypatch.setattr(subprocess, "run", hanging)
    assert drawn("egl") == Drawing(None, "no frame came in 30 s")


def test_display() -> None:
    assert told(display({"DISPLAY": ":1"})) == [
        "ok display: DISPLAY is :1, where --gui opens the simulator's window"
    ]
    assert told(display({})) == [
        "note display: DISPLAY is not set; run without --gui, which needs it: "
        "terminal, `--view` and report show a run, too"
    ]


@pytest.mark.parametrize(
    ("value", "sentence"),
    [
        ("SECRET1234567890", "ok key: ROBOFLOW_API_KEY is set"),
        ("none", "ok key: ROBOFLOW_API_KEY is set"),
        ("", "note key: ROBOFLOW_API_KEY is not set; set it for models that Roboflow hosts"),
    ],
)
def test_whether_there_is_a_key_and_nothing_else_of_it(value: str, sentence: str) -> None:
    assert told(key({"ROBOFLOW_API_KEY": value})) == [sentence]


def test_a_server_that_answers_and_one_that_does_not() -> None:
    asked: list[str] = []
    assert told(server(lambda address: not asked.append(address))) == [
        "ok roboflow: https://serverless.roboflow.com answers"
    ]
    assert asked == ["https://serverless.roboflow.com"]
    assert told(server(lambda _: False)) == [
        "note roboflow: https://serverless.roboflow.com does not answer within 3 s; "
        "see to the network for models that Roboflow hosts; nothing else needs it"
    ]


class Grumpy(http.server.BaseHTTPRequestHandler):
    """Has an answer to everything, the same."""

    def do_GET(self) -> None:
        self.send_error(404)

    def log_message(self, format: str, *args: object) -> None:
        pass


@pytest.fixture
def grumpy() -> Iterator[str]:
    """The address of a server that knows nothing."""
    with http.server.HTTPServer(("127.0.0.1", 0), Grumpy) as served:
        threading.Thread(target=served.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{served.server_port}"
        served.shutdown()


@pytest.fixture
def silent() -> Iterator[str]:
    """The address of a server that takes calls and says nothing."""
    with socket.create_server(("127.0.0.1", 0)) as served:
        yield f"http://127.0.0.1:{served.getsockname()[1]}"


@pytest.fixture(autouse=True)
def no_proxy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("no_proxy", "127.0.0.1")


def test_any_answer_shows_that_a_server_is_there(grumpy: str) -> None:
    assert answers_in_time(grumpy, 10.0)


def test_a_server_is_not_waited_for(silent: str) -> None:
    assert not answers_in_time(silent, 0.05)


def test_no_server_at_all() -> None:
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        assert not answers_in_time(f"http://127.0.0.1:{nobody.getsockname()[1]}", 10.0)


def examined(monkeypatch: pytest.MonkeyPatch, findings: list[Finding], *words: str) -> Result:
    monkeypatch.setattr(doctor, "examined", lambda looks: findings)
    return CliRunner().invoke(main, ["doctor", *words])


FOUND = [Finding("ok", "python", "3.11"), Finding("note", "display", "is not set", "run without")]
WRONG = [*FOUND, Finding("problem", "packages", "av is missing", "run `uv sync`")]


def test_marks_and_subjects_are_aligned_and_notes_are_no_problems(monkeypatch: pytest.MonkeyPatch) -> None:
    result = examined(monkeypatch, FOUND)
    assert result.exit_code == 0
    assert result.stdout.splitlines() == [
        "ok       python   3.11",
        "note     display  is not set; run without",
        "all is well",
    ]


@pytest.mark.parametrize(("found", "total"), [(WRONG, "1 problem"), ([*WRONG, WRONG[-1]], "2 problems")])
def test_problems_are_counted_and_end_with_1(
    monkeypatch: pytest.MonkeyPatch, found: list[Finding], total: str
) -> None:
    result = examined(monkeypatch, found)
    assert result.exit_code == 1
    assert result.stdout.splitlines()[-2:] == ["problem  packages  av is missing; run `uv sync`", total]


def test_as_json_all_findings_are_one_array(monkeypatch: pytest.MonkeyPatch) -> None:
    result = examined(monkeypatch, WRONG, "--json")
    assert result.exit_code == 1
    assert json.loads(result.stdout) == [
        {"mark": "ok", "subject": "python", "told": "3.11", "cure": ""},
        {"mark": "note", "subject": "display", "told": "is not set", "cure": "run without"},
        {"mark": "problem", "subject": "packages", "told": "av is missing", "cure": "run `uv sync`"},
    ]


def test_a_package_that_a_look_needs_may_be_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "executive.cli.doctor.renderer", None)
    found = told(doctor.examined(["renderer.renderer", "display.display"]))
    assert found[0] == (
        "problem renderer: cannot be looked at: import of executive.cli.doctor.renderer halted; "
        "None in sys.modules; run `uv sync`"
    )
    assert len(found) == 2


def test_everything_is_looked_at_and_no_key_comes_out(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOFLOW_API_KEY", "SECRET1234567890")
    monkeypatch.setattr("executive.cli.doctor.renderer.drawn", lambda way: Drawing(9.0))
    monkeypatch.setattr("executive.cli.doctor.roboflow.answers_in_time", lambda address: False)
    result = CliRunner().invoke(main, ["doctor", "--json"])
    found = json.loads(result.stdout)
    subjects = ["python", "packages", "opencv", "registered", "renderer", "egl", "display", "view", "train"]
    assert list(dict.fromkeys(one["subject"] for one in found)) == [*subjects, "film", "key", "roboflow"]
    assert result.exit_code == int(any(one["mark"] == "problem" for one in found)) == 0
    assert "SECRET" not in result.output
