"""The directory of a run, and files that are there whole or not at all."""

from __future__ import annotations

import contextlib
import math
import os
import shutil
from dataclasses import replace
from datetime import datetime
from pathlib import Path

import pytest
from events import run_started

from executive.behaviours import load_skills
from executive.errors import InputError
from executive.mission.outline import Connection, OutlineNode
from executive.record.run_directory import (
    RunDirectory,
    find_run,
    format_tree,
    make_dated_folder,
    read_cell,
    read_mission_of_run,
    read_tree,
    write_atomically,
)

STARTED = datetime(2026, 11, 21, 3, 15, 42)


def create(runs: Path) -> RunDirectory:
    return RunDirectory(make_dated_folder(runs, "sort_s7", STARTED))


def test_is_named_after_time_mission_and_seed(tmp_path):
    names = [create(tmp_path / "runs").path.relative_to(tmp_path).as_posix() for _ in range(3)]
    assert names == [f"runs/2026-11-21/03-15-42_sort_s7{end}" for end in ("", "-2", "-3")]
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="not a directory; name another folder with --runs DIR"):
        create(tmp_path / "file" / "runs")


def test_latest_points_to_the_last_run_and_survives_moving_the_folder(tmp_path):
    for number in range(2):
        create(tmp_path / "runs").save_inputs({"mission.yaml": f"mission: {number}"}, {})
    (tmp_path / "runs").rename(tmp_path / "moved")
    assert (tmp_path / "moved" / "latest" / "mission.yaml").read_text() == "mission: 1"


@pytest.mark.parametrize("is_copy", [False, True])
def test_latest_is_never_an_earlier_run(is_copy: bool, tmp_path: Path) -> None:
    earlier_run = create(tmp_path)
    earlier_run.journal.touch()
    # A killed process leaves its temporary link; a copy of the folder contains a folder instead of the link.
    if is_copy:
        shutil.copytree(earlier_run.path, tmp_path / "latest")
    else:
        earlier_run.save_inputs({}, {})
        (tmp_path / f".latest-{os.getpid()}").symlink_to(earlier_run.path)
    later_run = create(tmp_path)
    later_run.journal.touch()
    later_run.save_inputs({}, {})
    with contextlib.suppress(InputError):
        assert find_run("latest", tmp_path) == later_run.path.resolve()


def test_what_repeats_a_run_is_on_the_disk_and_a_library_may_have_any_name(tmp_path, monkeypatch):
    synced = []
    monkeypatch.setattr(os, "fsync", lambda file: synced.append(os.fstat(file).st_ino))
    directory = create(tmp_path)
    names = ("library/sorting.yaml", "mission.yaml", "result.json", "frames/000001_cube.jpg")
    libraries = {name: f"library: {name}\n" for name in names}
    texts = {"mission.yaml": "mission: größe\n", "cell.yaml": "size: [1, 2]\n"}
    directory.save_inputs(texts, libraries)
    left = {f"libraries/{name}": text for name, text in libraries.items()} | texts
    assert {name: (directory.path / name).read_text() for name in left} == left
    assert synced == [(directory.path / name).stat().st_ino for name in left]
    assert {path.name for path in directory.path.iterdir()} == {"libraries", *texts}


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_what_was_there_before_stays_where_the_writing_stops(tmp_path, monkeypatch, error):
    def fails(*args):
        raise error

    write_atomically(tmp_path / "a.txt", "before")
    monkeypatch.setattr(Path, "replace", fails)
    with pytest.raises(type(error)):
        write_atomically(tmp_path / "a.txt", "after")
    assert (tmp_path / "a.txt").read_text() == "before"
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


def test_a_tree_is_read_as_it_was_written_and_values_that_json_lacks_as_text(tmp_path):
    file = tmp_path / "tree.json"
    leaf = OutlineNode(
        "tree/do/Grasp", "do: Grasp", 1, "", "skill", "Grasp", "do", "on Grasp.missed", ("pick",), "Grasp",
        "Close the tool.", {"settle": 0.1}, (Connection("target", "target", True),), (), ("missed",),
    )  # fmt: skip
    odd = OutlineNode("a", "a", 0, "", "skill", "A", params={"x": math.inf, "y": object})
    file.write_text(format_tree([leaf, odd]))
    read_leaf, read_odd = read_tree(file)
    assert read_leaf == leaf
    assert read_odd.params["x"] == "Infinity" and "object" in read_odd.params["y"]
    file.write_text("{}")
    with pytest.raises(InputError, match="contains no tree of a run"):
        read_tree(file)


def test_the_run_of_an_earlier_version_is_neither_replayed_nor_resumed(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="can be reported, but neither replayed nor resumed"):
        read_mission_of_run(tmp_path, replace(run_started(), format=3), load_skills())


BOMB = "a0: &a0 x\n" + "".join(f"a{n}: &a{n} [{', '.join([f'*a{n - 1}'] * 9)}]\n" for n in range(1, 9))


@pytest.mark.parametrize(
    ("read", "text", "error"),
    [
        (read_cell, BOMB, r"cell\.yaml:\d: the file has more than 20000 keys and values"),
        (read_cell, " " * 1_000_001, r"cell\.yaml is larger than 1000000 bytes"),
        (read_cell, "a: !!python/name:os.system ''", "could not determine a constructor for the tag"),
        (lambda path: read_tree(path / "cell.yaml"), f"[{'0,' * 1_000_000}0]", "contains no tree of a run"),
        (lambda path: read_tree(path / "pipe"), "", "pipe is a pipe or a device, not a file"),
    ],
)
def test_files_of_a_run_are_read_within_bounds(tmp_path, read, text, error):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "cell.yaml").write_text(text)
    with pytest.raises(InputError, match=error):
        read(tmp_path)
