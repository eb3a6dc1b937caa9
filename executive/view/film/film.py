"""A recorded run as a film: the world rebuilt and looked at, beside it what the tree decided."""

from __future__ import annotations

from collections.abc import Callable, Generator
from contextlib import closing
from pathlib import Path

from PIL import Image

from executive.sim.shots import Shoot, shots, steps_in
from executive.sim.viewpoint import overview
from executive.view.film.course import Course
from executive.view.film.ending import draw_ending
from executive.view.film.formats import Format
from executive.view.film.page import Book, draw_page
from executive.view.film.source import Source
from executive.view.film.stage import STAGE
from executive.view.film.timetable import Timetable

SHOWN = (24, 76, 776, 644)
"""Part of the picture that arm, workspace and bins fill [pixel]; what is written stands around it."""

Progress = Callable[[int, int], None]
"""Told how many frames of how many are done."""


def film(
    source: Source, file: Path, format: Format, *, speed: float, workers: int, progress: Progress
) -> int:
    """Film a run, and return how many frames that took.

    Args:
        source: The record of the run.
        file: Where to write the film.
        format: What it is to be.
        speed: Seconds on the robot's clock per second of the film.
        workers: Processes that take the pictures.
        progress: Told how many frames of how many are done.
    """
    timetable = Timetable(steps_in(source.directory.world), source.start["step"], format.rate, speed)
    with closing(_pages(source, timetable, workers, progress)) as pages:
        format.write(file, pages, format.rate)
    return timetable.frames


def _pages(
    source: Source, timetable: Timetable, workers: int, progress: Progress
) -> Generator[Image.Image, None, None]:
    """Yield the frames of a film."""
    book = _book(source, timetable)
    course = Course(source.past.entries, source.nodes, list(source.directory.frames.glob("*.jpg")))
    shoot = Shoot(
        source.config,
        int(source.start["seed"]),
        source.directory.world,
        overview(source.config, STAGE, SHOWN),
    )
    with closing(shots(shoot, timetable.shown, workers)) as pictures:
        for done, (step, picture) in enumerate(zip(timetable.shown, pictures, strict=True), start=1):
            clock = timetable.clock(step)
            course.go_to(step, clock)
            page = draw_page(book, picture, course, clock)
            progress(done, timetable.frames)
            yield page
    last = draw_ending(draw_page(book, picture, course, clock, caption=False), source.ending)
    for held in range(1, timetable.held + 1):
        progress(done + held, timetable.frames)
        yield last


def _book(source: Source, timetable: Timetable) -> Book:
    """Return what stays the same on every page."""
    note = [f"seed {source.start['seed']}", f"cell {source.config.cell}"]
    if timetable.speed != 1:
        note.append(f"{timetable.speed:g}x speed")
    bins = {
        name: "#" + "".join(f"{round(255 * share):02x}" for share in bin.colour)
        for name, bin in source.config.bins.items()
    }
    return Book(
        title=str(source.start["mission"]),
        note=" · ".join(note),
        nodes=source.nodes,
        items=source.items,
        bins=bins,
        length=timetable.clock(timetable.steps),
    )
