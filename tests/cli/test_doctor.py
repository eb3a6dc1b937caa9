"""`executive doctor`: findings about installations in which something is missing."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from at_terminal import invoke

from executive import plugins
from executive.behaviours import load_skills
from executive.cli import setup
from executive.cli.setup import CheckResult
from executive.errors import InputError
from executive.plugins import DISTRIBUTION


def find_statuses(results: Iterator[CheckResult]) -> dict[str, str]:
    """Return the statuses of checks by subject."""
    return {result.subject: result.status for result in results}


def test_environment_variables_are_named_without_their_values(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setenv("ROBOFLOW_API_KEY", "SECRET1234567890")
    python, display = setup.check_system()
    assert (python.status, python.subject) == ("ok", "python")
    assert (display.status, display.message) == ("note", "DISPLAY is not set; it is only for --gui")


@pytest.mark.parametrize(
    ("missing", "status_by_subject"),
    [
        ((), {}),
        (("pybullet",), {"packages": "problem"}),
        (("aiohttp", "torch"), {"view": "note", "train": "note"}),
        ((DISTRIBUTION,), {}),
    ],
)
def test_missing_packages_are_problems_and_missing_extras_are_notes(
    monkeypatch: pytest.MonkeyPatch, missing: tuple[str, ...], status_by_subject: dict[str, str]
) -> None:
    names = {
        "": ("pybullet", "av"),
        "arms": ("eaik",),
        "view": ("viser", "aiohttp"),
        "cluster": ("dask",),
        "train": ("torch",),
    }
    monkeypatch.setattr(plugins, "find_version", lambda name: "" if name in missing else "1.0")
    monkeypatch.setattr(plugins, "list_requirements", names.__getitem__)
    results = list(setup.check_packages())
    assert find_statuses(iter(results)) == status_by_subject
    assert all(any(name in result.message for name in missing) for result in results)


def test_two_packages_that_provide_cv2_are_a_problem(monkeypatch: pytest.MonkeyPatch) -> None:
    packages = {"cv2": ["opencv-python-headless", "opencv-python"]}
    monkeypatch.setattr("importlib.metadata.packages_distributions", lambda: packages)
    assert find_statuses(setup.check_packages())["opencv"] == "problem"


@pytest.mark.parametrize("group", ["drivers", "detectors"])
def test_a_plugin_that_cannot_be_loaded_is_an_error(
    group: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    (plugins,) = setup.check_plugins()
    assert plugins == ("ok", "plugins", f"{len(load_skills())} skills")
    Path("pyproject.toml").write_text(f'[project.entry-points."executive.{group}"]\nbench = "no:Bench"\n')
    with pytest.raises(InputError, match='"bench"'):
        list(setup.check_plugins())


@pytest.mark.parametrize("status", ["note", "problem"])
def test_only_a_problem_makes_the_command_fail(monkeypatch: pytest.MonkeyPatch, status: str) -> None:
    result = CheckResult(status, "packages", "av is missing")
    monkeypatch.setattr(setup, "run_checks", lambda: [result])
    text, as_json = (invoke("doctor", *options) for options in ((), ("--json",)))
    assert text.exit_code == as_json.exit_code == (status == "problem")
    assert text.stdout.split(maxsplit=2) == [status, "packages", "av is missing\n"]
    assert json.loads(as_json.stdout) == [result._asdict()]


def test_all_checks_run_although_one_fails(monkeypatch: pytest.MonkeyPatch) -> None:
    def fail() -> None:
        raise InputError("the skill is broken; correct it")

    monkeypatch.setattr("executive.behaviours.load_skills", fail)
    monkeypatch.setitem(sys.modules, "executive.perception.detectors.roboflow.inference_process", None)
    statuses = find_statuses(setup.run_checks())
    assert {name: statuses[name] for name in ("system", "plugins", "simulator")} == {
        "system": "problem", "plugins": "problem", "simulator": "ok"
    }  # fmt: skip
