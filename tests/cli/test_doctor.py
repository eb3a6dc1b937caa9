"""The findings of `executive doctor`, each sentence, on any installation."""

from __future__ import annotations

import http.server
import json
import re
import socket
import sys
import threading
from pathlib import Path

import pytest
from click.testing import CliRunner

from executive.cli import doctor
from executive.cli.doctor import CheckResult
from executive.cli.main import main
from executive.errors import InputError
from executive.plugins import load_skills
from executive.run import versions

INSTALLED = {
    "executive": "1.0", "pybullet": "3.2", "av": "14.0", "viser": "1.1", "aiohttp": "3.11",
    "opencv-python-headless": "4.12", "opencv-python": "5.0",
}  # fmt: skip
NEEDED = {
    "": ("pybullet", "av"), "view": ("viser", "aiohttp"),
    "cluster": ("dask",), "train": ("torch", "onnx"),
}  # fmt: skip
CLUSTER = (
    "note cluster: not installed: dask; to run a sweep on several computers, run `uv sync --extra cluster`"
)
TORCH = "note train: not installed: torch, onnx; to train a detector of your own, run `uv sync --extra train`"
VIEW = "ok view: viser 1.1, aiohttp 3.11"
FILM = "ok film: av 14.0 encodes videos; the program ffmpeg is not needed"


def shown(findings) -> list[str]:
    return [f"{mark} {subject}: {'; '.join(filter(None, rest))}" for mark, subject, *rest in findings]


@pytest.mark.parametrize(
    ("version", "mark", "end"),
    [
        ((3, 9, 1), "problem", " has no pybullet wheel; use Python 3.10 or 3.11 (uv installs 3.11)"),
        ((3, 10, 0), "ok", ""),
        ((3, 11, 7), "ok", ""),
        ((3, 12, 0), "problem", " has no pybullet wheel; use Python 3.10 or 3.11 (uv installs 3.11)"),
    ],
)
def test_python(version, mark, end):
    first, *_ = shown(doctor.check_system(version))
    assert first.startswith(f"{mark} python: {'.'.join(map(str, version))} on ")
    assert first.endswith(end)
    assert ("wheel" in first) == (mark == "problem")


def test_display(monkeypatch):
    monkeypatch.setenv("DISPLAY", ":1")
    assert shown(doctor.check_system())[1:] == [
        "ok display: DISPLAY is :1; --gui opens the window of the simulator there"
    ]
    monkeypatch.delenv("DISPLAY")
    assert shown(doctor.check_system())[1:] == [
        "note display: DISPLAY is not set; run without --gui; "
        "the terminal, --view and the report also show a run"
    ]


NEEDED_ARE_THERE = "ok packages: executive 1.0 and its 2 required packages"
ONE_CV2 = "ok opencv: opencv-python-headless 4.12 is the only package that provides `cv2`"
TWO_CV2 = (
    "problem opencv: 2 packages provide `cv2` and overwrite each other (opencv-python 5.0, "
    "opencv-python-headless 4.12); run `uv sync --reinstall`, which removes all but opencv-python-headless"
)
NO_VIEW = "note view: not installed: aiohttp; to watch a run in the browser, run `uv sync --extra view`"
MISSING = [f"problem packages: {name} is missing; run `uv sync`" for name in ("executive", "pybullet", "av")]


@pytest.mark.parametrize(
    ("missing", "opencv", "expected"),
    [
        ((), ["opencv-python-headless"] * 2, [NEEDED_ARE_THERE, ONE_CV2, VIEW, CLUSTER, TORCH, FILM]),
        (("executive", "pybullet", "av", "aiohttp"), [], [*MISSING, NO_VIEW, CLUSTER, TORCH]),
        (
            (),
            ["opencv-python-headless", "opencv-python"],
            [NEEDED_ARE_THERE, TWO_CV2, VIEW, CLUSTER, TORCH, FILM],
        ),
    ],
)
def test_packages(monkeypatch, missing, opencv, expected):
    monkeypatch.setattr(
        versions, "find_version", lambda name: "" if name in missing else INSTALLED.get(name, "")
    )
    monkeypatch.setattr(versions, "list_requirements", lambda extra="": NEEDED[extra])
    monkeypatch.setattr(
        "importlib.metadata.packages_distributions", lambda: {"cv2": opencv} if opencv else {}
    )
    assert shown(doctor.check_packages()) == expected


def test_an_environment_made_with_pip_is_corrected_with_pip(monkeypatch):
    monkeypatch.setattr(versions, "find_installer", lambda name: "pip")
    packages = {"cv2": ["opencv-python-headless", "opencv-python"]}
    monkeypatch.setattr("importlib.metadata.packages_distributions", lambda: packages)
    (problem,) = (finding for finding in doctor.check_packages() if finding.subject == "opencv")
    assert problem.fix == (
        "run `pip uninstall -y opencv-python opencv-python-headless`, "
        "then `pip install opencv-python-headless`"
    )


def test_everything_registered_is_counted_and_loaded(tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    counts = f"{len(load_skills())} skills, 2 kinds of cells, 4 kinds of detectors"
    assert shown(doctor.check_plugins()) == [f"ok plugins: {counts}"]
    Path("pyproject.toml").write_text("[project]\n")
    assert shown(doctor.check_plugins())[0].endswith(
        f"detectors, including those of {tmp_path}/pyproject.toml"
    )
    for group in ("cells", "detectors"):
        Path("pyproject.toml").write_text(f'[project.entry-points."executive.{group}"]\nbench = "no:Bench"\n')
        with pytest.raises(InputError, match=r'"bench" \(no:Bench\) cannot be loaded: ModuleNotF'):
            list(doctor.check_plugins())


def test_the_renderer_draws():
    assert re.match(r"ok renderer: TinyRenderer, on the CPU: \d+ ms", shown(doctor.check_renderer())[0])


HOSTED = "https://serverless.roboflow.com"
KEYLESS = "note key: ROBOFLOW_API_KEY is not set; set it to use models that Roboflow hosts"
SILENT = (
    f"note roboflow: {HOSTED} does not answer within 3 s; "
    "check the network; only models that Roboflow hosts need it"
)


@pytest.mark.parametrize(
    ("secret", "answers", "expected"),
    [
        ("SECRET1234567890", True, ["ok key: ROBOFLOW_API_KEY is set", f"ok roboflow: {HOSTED} answers"]),
        ("", False, [KEYLESS, SILENT]),
    ],
)
def test_the_server_of_roboflow_and_the_key(monkeypatch, secret, answers, expected):
    monkeypatch.setattr(doctor, "is_reachable", lambda address: answers and address == HOSTED)
    monkeypatch.setenv("ROBOFLOW_API_KEY", secret)
    assert shown(doctor.check_roboflow()) == expected


class Refusing(http.server.BaseHTTPRequestHandler):
    """Answers every request with an error."""

    def do_GET(self) -> None:
        self.send_error(404)

    def log_message(self, format: str, *args: object) -> None:
        pass


def test_any_answer_in_time_shows_that_a_server_is_there(monkeypatch):
    monkeypatch.setenv("no_proxy", "127.0.0.1")
    with http.server.HTTPServer(("127.0.0.1", 0), Refusing) as served:
        threading.Thread(target=served.serve_forever, daemon=True).start()
        assert doctor.is_reachable(f"http://127.0.0.1:{served.server_port}", 10.0)
        served.shutdown()
    with socket.create_server(("127.0.0.1", 0)) as silent:
        assert not doctor.is_reachable(f"http://127.0.0.1:{silent.getsockname()[1]}", 0.05)
    with socket.socket() as nobody:
        nobody.bind(("127.0.0.1", 0))
        assert not doctor.is_reachable(f"http://127.0.0.1:{nobody.getsockname()[1]}", 10.0)


NOTE = CheckResult("note", "display", "is not set", "run without")
PROBLEM = CheckResult("problem", "packages", "av is missing", "run `uv sync`")


@pytest.mark.parametrize(
    ("findings", "code", "total"),
    [([], 0, "no problems"), ([PROBLEM], 1, "1 problem"), ([PROBLEM] * 2, 1, "2 problems")],
)
def test_marks_and_subjects_are_aligned_and_problems_counted(monkeypatch, findings, code, total):
    monkeypatch.setattr(doctor, "run_checks", lambda: [CheckResult("ok", "python", "3.11"), NOTE, *findings])
    result = CliRunner().invoke(main, ["doctor"])
    width = 8 if findings else 7
    assert result.stdout.splitlines() == [
        f"ok       {'python':{width}}  3.11",
        f"note     {'display':{width}}  is not set; run without",
        *["problem  packages  av is missing; run `uv sync`"] * len(findings),
        total,
    ]
    as_json = CliRunner().invoke(main, ["doctor", "--json"])
    assert result.exit_code == as_json.exit_code == code
    assert json.loads(as_json.stdout)[1] == {
        "status": "note", "subject": "display", "message": "is not set", "fix": "run without"
    }  # fmt: skip


def test_everything_is_examined_whatever_fails(monkeypatch):
    def fail() -> None:
        raise InputError("the skill is broken; correct it")

    monkeypatch.setattr("executive.plugins.load_skills", fail)
    monkeypatch.setitem(sys.modules, "executive.perception.detectors.roboflow.inference_process", None)
    found = shown(doctor.run_checks())
    assert [line.split(": ")[0].split(" ")[1] for line in found] == [
        "python", "display", "packages", "opencv", "view", "cluster", "train", "film",
        "plugins", "renderer", "roboflow",
    ]  # fmt: skip
    assert found[8] == "problem plugins: the skill is broken; correct it"
    assert found[-1].startswith(
        "problem roboflow: cannot be checked: import of executive.perception.detectors.r"
    )
    assert found[-1].endswith("; run `uv sync`")
