"""The bar that says how far a command is: at a terminal with the time left, elsewhere not at all."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from at_terminal import COLOUR, call
from click.testing import CliRunner, Result

from executive.cli.main import main
from executive.cli.progress import show_progress
from executive.training.dataset import DatasetEntry, build_image_path, save_image, write_annotations

FAKE = ("--set", "cell.kind=fake")


def test_a_bar_shows_how_many_of_how_many(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    with show_progress("sorting") as move:
        move(3, 10)
    captured = capsys.readouterr()
    assert captured.out == ""
    assert "sorting" in captured.err and "3/10" in captured.err and "-:--:--" in captured.err


@pytest.mark.parametrize(
    ("environment", "quiet"), [({}, False), ({"FORCE_COLOR": "1", "TERM": "dumb"}, False), ({}, True)]
)
def test_nothing_is_drawn_where_nothing_can_be_drawn_over(
    environment: dict[str, str],
    quiet: bool,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.delenv("FORCE_COLOR", raising=False)
    for name, value in environment.items():
        monkeypatch.setenv(name, value)
    with show_progress("sorting", quiet=quiet) as move:
        move(3, 10)
    assert capsys.readouterr() == ("", "")


def test_without_a_terminal_some_work_writes_lines(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    times = iter([0.0, 4.0, 12.0, 13.0])
    monkeypatch.setattr("time.monotonic", lambda: next(times))
    with show_progress("frames", print_lines=True) as move:
        for done in (1, 3, 4):
            move(done, 9)
    assert capsys.readouterr() == ("", "frames: 3 of 9, 15.0 per minute, about 24 s left\n")


@pytest.fixture
def at_terminal(monkeypatch: pytest.MonkeyPatch) -> Callable[..., Result]:
    """Calls a command whose standard error passes for a terminal."""
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    return lambda *words: CliRunner().invoke(main, words)


@pytest.fixture
def grey(tmp_path: Path) -> Path:
    """A data set of two grey images."""
    root = tmp_path / "grey"
    box = (10.0, 10.0, 60.0, 60.0)
    entries = [DatasetEntry("test", f"{name}.jpg", (160, 120), ("cube",), (box,)) for name in "ab"]
    for entry in entries:
        save_image(build_image_path(root, "coco", "test", entry.file), np.full((120, 160, 3), 128, np.uint8))
    write_annotations(root, "coco", entries, ("cube", "sphere", "duck"))
    return root


def test_evaluate_shows_how_many_images_were_searched(at_terminal: Callable[..., Result], grey: Path) -> None:
    shown = at_terminal("evaluate", "--dataset", str(grey))
    assert shown.exit_code == 0, shown.stderr
    assert "running embedded" in shown.stderr and "2/2" in shown.stderr


@pytest.mark.slow
def test_dataset_shows_how_many_images_were_rendered(
    at_terminal: Callable[..., Result], tmp_path: Path
) -> None:
    out = tmp_path / "data"
    shown = at_terminal("dataset", "overhead", "--out", str(out), "--images", "2", "--workers", "1")
    assert shown.exit_code == 0, shown.stderr
    assert "rendering" in shown.stderr and "2/2" in shown.stderr
    assert len(list(out.rglob("*.jpg"))) == 2


def test_train_shows_batches_and_a_line_per_epoch(
    at_terminal: Callable[..., Result], monkeypatch: pytest.MonkeyPatch
) -> None:
    def train(dataset, out, settings, progress, batches):
        for done in range(1, 2 * settings.epochs + 1):
            batches(done, 2 * settings.epochs)
            if done % 2 == 0:
                progress(done // 2, {"loss": 0.51234})

    monkeypatch.setattr("executive.training.train.train", train)
    monkeypatch.setattr("executive.training.train.load_dataset", lambda _folder: {})
    shown = at_terminal("train", "--dataset", "data", "--out", "out", "--epochs", "2")
    assert shown.exit_code == 0, shown.stderr
    assert "training" in shown.stderr and "4/4" in shown.stderr
    assert "epoch 1 of 2: loss 0.5123" in shown.stderr
    assert "epoch 2 of 2: loss 0.5123" in shown.stderr
    assert "    kind: rfdetr\n    model_path: out/model.onnx\n    labels: out/labels.txt\n" in shown.stderr
    assert shown.stdout == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("words", "what"),
    [
        (("sweep", "sort_overhead", *FAKE, "--seeds", "0-1", "--runs", "runs"), "sort_overhead"),
        (("faults", "sort_overhead", *FAKE, "--pairs", "2"), "faults"),
    ],
)
def test_many_runs_show_how_many_are_done_at_a_terminal_alone(
    words: tuple[str, ...], what: str, tmp_path: Path
) -> None:
    at_terminal = call(*words, folder=tmp_path, terminal=True)
    assert at_terminal.code == 0, at_terminal.stderr
    assert what in at_terminal.stderr and "2/2" in at_terminal.stderr and "0:00:00" in at_terminal.stderr
    assert COLOUR.search(at_terminal.stderr)
    piped = call(*words, folder=tmp_path, terminal=False)
    assert piped.code == 0, piped.stderr
    assert "2/2" not in piped.stderr and "\x1b" not in piped.stderr and "━" not in piped.stderr


@pytest.mark.slow
def test_a_run_is_drawn_at_a_terminal_in_colours_unless_nobody_wants_them(tmp_path: Path) -> None:
    words = ("run", "sort_overhead", *FAKE, "--runs", "runs")
    coloured = call(*words, folder=tmp_path, terminal=True)
    plain = call(*words, folder=tmp_path, terminal=True, NO_COLOR="1")
    piped = call(*words, folder=tmp_path, terminal=False)
    assert coloured.code == plain.code == piped.code == 0
    assert "▶" in coloured.stderr and COLOUR.search(coloured.stderr)
    assert "▶" in plain.stderr and not COLOUR.search(plain.stderr)
    assert "▶" not in piped.stderr and "\x1b" not in piped.stderr
    assert "sort_overhead starts, seed 0" in piped.stderr
