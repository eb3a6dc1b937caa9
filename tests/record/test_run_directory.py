"""The directory a run leaves."""

from __future__ import annotations

import errno
import os
from datetime import datetime
from pathlib import Path

import pytest

from executive.errors import InputError
from executive.record.run_directory import RunDirectory, convert_os_errors, make_dated_folder

STARTED = datetime(2026, 11, 21, 3, 15, 42)


def create(runs: Path) -> RunDirectory:
    return RunDirectory(make_dated_folder(runs, "sort_s7", STARTED))


def test_is_named_after_time_mission_and_seed(tmp_path):
    names = [create(tmp_path / "runs").path.relative_to(tmp_path).as_posix() for _ in range(3)]
    assert names == [f"runs/2026-11-21/03-15-42_sort_s7{end}" for end in ("", "-2", "-3")]


def full(*args, **kwargs):
    raise OSError(28, "No space left on device")


def test_latest_points_to_the_last_run_and_survives_moving_the_folder(tmp_path):
    for number in range(2):
        directory = create(tmp_path / "runs")
        directory.save_inputs({"mission.yaml": f"mission: {number}"}, {})
    (tmp_path / "runs").rename(tmp_path / "moved")
    assert (tmp_path / "moved" / "latest" / "mission.yaml").read_text() == "mission: 1"


def test_what_repeats_a_run_is_on_the_disk_and_libraries_lie_where_the_mission_looks(tmp_path, monkeypatch):
    synced = []
    monkeypatch.setattr(os, "fsync", lambda file: synced.append(os.fstat(file).st_ino))
    directory = create(tmp_path)
    libraries = {"library/sorting.yaml": "library: sorting\n", "own.yaml": "library: own\n"}
    texts = {"mission.yaml": "mission: a  # mine\n", "params.yaml": "{}\n", "cell.yaml": "size: [1, 2]\n"}
    directory.save_inputs(texts, libraries)
    left = {**libraries, **texts}
    assert {name: (directory.path / name).read_text() for name in left} == left
    assert synced == [(directory.path / name).stat().st_ino for name in left]


def test_a_place_that_cannot_be_written_to_is_a_sentence(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(InputError) as raised:
        create(tmp_path / "file" / "runs")
    assert str(raised.value) == (
        f'cannot make a run directory below "{tmp_path}/file/runs": not a directory; '
        "name another folder with --runs DIR"
    )


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG])
def test_space_is_spoken_of_where_it_is_what_is_missing(number):
    reason = os.strerror(number)
    with pytest.raises(InputError) as raised, convert_os_errors("write"):
        raise OSError(number, reason)
    assert str(raised.value) == (
        f"cannot write: {reason.lower()}; name another folder with --runs DIR"
    )


@pytest.mark.parametrize("room", range(3))
def test_a_full_disk_is_a_sentence_and_leaves_nothing_half_written(tmp_path, monkeypatch, room):
    texts = dict.fromkeys(("mission.yaml", "params.yaml", "cell.yaml"), "text")
    create(tmp_path).save_inputs(texts, {})
    before = (tmp_path / "latest").resolve()
    directory = create(tmp_path)
    left = iter(range(room))
    monkeypatch.setattr(os, "fsync", lambda file: None if next(left, None) is not None else full())
    with pytest.raises(InputError, match="no space left on device; name another"):
        directory.save_inputs(texts, {})
    names = [path.name for path in directory.path.iterdir()]
    assert sorted(names) == sorted(list(texts)[:room])
    assert (tmp_path / "latest").resolve() == before
