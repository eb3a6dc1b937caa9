"""Standing between a skill and a part of its cell."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any


class Intercepted:
    """A part of a cell, some of whose methods go through a function.

    Args:
        part: The part; whatever else it is asked, it answers itself.
        through: By name of a method, what is called in its place: with the method, then its arguments.
    """

    def __init__(self, part: Any, through: Mapping[str, Callable[..., Any]]) -> None:
        self._part = part
        self._through = through

    def __getattr__(self, name: str) -> Any:
        value = getattr(self._part, name)
        return partial(self._through[name], value) if name in self._through else value
