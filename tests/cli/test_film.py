"""`executive film`, by the command line."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
from click.testing import CliRunner

from executive.cli.main import main


def invoke(*words: str):
    return CliRunner().invoke(main, words)


@pytest.fixture
def run(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A run directory that counts as one that can be filmed; its films are made at once."""
    path = tmp_path / "runs" / "2026-11-22" / "10-00-00_sort_s5"
    path.mkdir(parents=True)
    (path / "journal.jsonl").touch()
    (tmp_path / "runs" / "latest").symlink_to(path)

    def write_film(source, file, format, speed, workers, progress):
        file.write_text(f"{source.directory.path.name} {format.suffix} {speed:g} {workers}")
        progress(30, 30)
        return 30

    monkeypatch.setattr(
        "executive.view.film.run_state.FilmSource",
        lambda directory: SimpleNamespace(directory=directory, events=[SimpleNamespace(clock=4.0)]),
    )
    monkeypatch.setattr("executive.view.film.film.write_film", write_film)
    return path


def test_a_film_is_made_where_it_was_wanted(run: Path, tmp_path: Path) -> None:
    out = tmp_path / "a.mp4"
    done = invoke("film", "latest", "--runs", str(run.parents[1]), "-o", str(out), "--json", "--workers", "3")
    assert done.exit_code == 0, done.output
    assert out.read_text() == "10-00-00_sort_s5 .mp4 1 3"
    printed = json.loads(done.stdout)
    assert printed == {"file": str(out), "frames": 30, "seconds": 1.2, "size": out.stat().st_size}
    assert done.stderr.startswith("making a film of about 6 s\n")
    assert f"{out}: 1.2 s, 0.0 MB" in done.stderr.replace("\n", "")


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("-o", "a.mp4", "--gif"), '"a.mp4" cannot be a GIF'),
        (("-o", "a.webm"), '"a.webm" cannot be a film'),
        (("-o", "/nowhere/a.mp4"), 'cannot write the film "/nowhere/a.mp4": no such file or directory'),
        (("--speed", "0"), "0.1<=x<=100"),
    ],
)
def test_what_makes_no_film_is_refused(run: Path, words: tuple[str, ...], sentence: str) -> None:
    refused = invoke("film", str(run), *words)
    assert refused.exit_code == 2
    assert sentence in refused.stderr


def test_a_run_on_a_cell_that_is_not_simulated_is_refused(tmp_path: Path) -> None:
    runs = ("--runs", str(tmp_path))
    assert invoke("run", "sort_fruit", "--seed", "4", "--quiet", *runs).exit_code == 0
    refused = invoke("film", "latest", *runs, "-o", str(tmp_path / "a.mp4"))
    assert refused.exit_code == 2
    assert "its cell has no simulated world; film a run on a cell of `kind: sim`" in refused.stderr
    assert not (tmp_path / "a.mp4").exists()
    assert invoke("film", "nowhere", *runs).exit_code == 2


@pytest.mark.parametrize(
    ("words", "file", "made"),
    [
        ("--quiet -o {tmp}/a.gif", "{tmp}/a.gif", ".gif 2 2"),
        ("-o {tmp}/b.gif --speed 1.5", "{tmp}/b.gif", ".gif 1.5 2"),
        ("", "{run}/film.mp4", ".mp4 1 2"),
        ("--gif", "{run}/film.gif", ".gif 2 2"),
    ],
)
def test_name_form_and_speed_are_chosen_and_nothing_is_written_over(
    run: Path, tmp_path: Path, words: str, file: str, made: str
) -> None:
    words, path = words.format(tmp=tmp_path), Path(file.format(tmp=tmp_path, run=run))
    assert invoke("film", str(run), *words.split()).exit_code == 0
    assert path.read_text() == f"10-00-00_sort_s5 {made}"
    path.write_text("mine")
    refused = invoke("film", str(run), *words.split())
    assert (refused.exit_code, path.read_text()) == (2, "mine")
    assert refused.stderr.endswith("exists; name another file with -o, or overwrite it with --force\n")
    assert invoke("film", str(run), *words.split(), "--force").exit_code == 0
    assert path.read_text() == f"10-00-00_sort_s5 {made}"
