"""The observer that keeps the record: what it lacks is told, and ends nothing that can go on."""

from __future__ import annotations

import os

import pytest
from events import at, run_ended

from executive.events import NodeStarted
from executive.record.journal import read_journal
from executive.record.picture_recorder import PictureRecorder
from executive.record.recorder import Recorder
from executive.record.run_directory import RunDirectory

STATUS, END = at(0, NodeStarted("a")), at(1, run_ended())


@pytest.fixture
def directory(tmp_path):
    return RunDirectory(tmp_path)


def full(*args):
    raise OSError(28, "No space left on device")


def test_a_picture_that_cannot_be_drawn_is_reported_and_the_run_continues(directory, monkeypatch):
    # No event can be asked for its data.
    monkeypatch.setattr(PictureRecorder, "__call__", lambda self, event: event["kind"])
    recorder = Recorder(directory)
    recorder(STATUS)
    recorder(END)
    recorder.close()
    problem = "not every picture was drawn: TypeError: 'TimedEvent' object is not subscriptable"
    assert (recorder.problem, len(read_journal(directory.journal))) == (problem, 2)


def test_the_pictures_are_waited_for_whatever_became_of_the_journal(directory, monkeypatch):
    closed = []

    def close(pictures, wait):
        closed.append(wait)
        pictures.problem = "no pictures were drawn: file exists"

    monkeypatch.setattr(PictureRecorder, "close", close)
    monkeypatch.setattr(os, "fsync", full)
    recorder = Recorder(directory)
    recorder(STATUS)
    recorder.close(wait=False)
    assert closed == [False]
    recorder.close()
    assert closed == [False, True]
    first, second = recorder.problem.split("; check what the tool holds and what is in the bins; ")
    assert "may lack its last lines" in first
    assert second == "no pictures were drawn: file exists"
