"""Files that are there whole or not at all."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from executive.record.atomic_file import write_atomically


def test_a_file_gets_a_content_that_is_on_the_disk(tmp_path, monkeypatch):
    sizes = []
    monkeypatch.setattr(os, "fsync", lambda file: sizes.append(os.fstat(file).st_size))
    write_atomically(tmp_path / "a.txt", "größe\n")
    assert (tmp_path / "a.txt").read_bytes() == "größe\n".encode()
    assert sizes == [len("größe\n".encode())]
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]


@pytest.mark.parametrize("call", ["fsync", "replace"])
@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_what_was_there_before_stays_where_the_writing_stops(tmp_path, monkeypatch, call, error):
    def fails(*args):
        raise error

    write_atomically(tmp_path / "a.txt", "before")
    monkeypatch.setattr(os, call, fails)
    monkeypatch.setattr(Path, "replace", lambda self, target: os.replace(self, target))
    with pytest.raises(type(error)):
        write_atomically(tmp_path / "a.txt", "after")
    with pytest.raises(UnicodeEncodeError):
        write_atomically(tmp_path / "a.txt", "caf\udce9")
    assert (tmp_path / "a.txt").read_text() == "before"
    assert [path.name for path in tmp_path.iterdir()] == ["a.txt"]
