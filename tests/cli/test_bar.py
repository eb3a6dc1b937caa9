"""The bar that says how far a command is: at a terminal with the time left, elsewhere not at all."""

from __future__ import annotations

from pathlib import Path

import pytest
from at_terminal import COLOUR, call, invoke

from executive.cli.shared import show_progress

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


def test_train_shows_batches_and_a_line_per_epoch(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in {"FORCE_COLOR": "1", "NO_COLOR": "1", "TERM": "xterm"}.items():
        monkeypatch.setenv(name, value)

    def train(dataset, out, *, epochs, report_epoch, report_batch, **settings):
        for done in range(1, 2 * epochs + 1):
            report_batch(done, 2 * epochs)
            if done % 2 == 0:
                report_epoch(done // 2, {"loss": 0.51234})

    monkeypatch.setattr("executive.training.train.train", train)
    monkeypatch.setattr("executive.training.train.load_dataset", lambda _folder: {})
    shown = invoke("train", "--dataset", "data", "--out", "out", "--epochs", "2")
    assert shown.exit_code == 0, shown.stderr
    assert "training" in shown.stderr and "4/4" in shown.stderr
    assert "epoch 1 of 2: loss 0.5123" in shown.stderr
    assert "epoch 2 of 2: loss 0.5123" in shown.stderr
    assert "    kind: rfdetr\n    model_path: out/model.onnx\n    labels: out/labels.txt\n" in shown.stderr
    assert shown.stdout == ""


@pytest.mark.slow
def test_many_runs_show_how_many_are_done_at_a_terminal_alone(tmp_path: Path) -> None:
    words = ("sweep", "sort_overhead", "--set", "cell.kind=fake", "--seeds", "0-1", "--runs", "runs")
    for is_terminal in (True, False):
        shown = call(*words, folder=tmp_path, terminal=is_terminal)
        assert shown.code == 0, shown.stderr
        assert ("2/2" in shown.stderr, bool(COLOUR.search(shown.stderr))) == (is_terminal, is_terminal)
