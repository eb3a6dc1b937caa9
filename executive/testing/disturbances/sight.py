"""What can happen to the view: the arm before the lens, or no depth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from executive.errors import NoDepth
from executive.geometry import Array
from executive.messages import Frame
from executive.testing.disturbances.effect import Effect, Occasion


@dataclass(frozen=True)
class WorkspaceHidden(Effect):
    """The arm hides everything from the camera."""

    name: ClassVar = "workspace_hidden"

    def sees_table(self, ask: Callable[[], bool], now: Occasion) -> bool:
        """Say no."""
        del ask
        now.tell()
        return False

    def capture(self, ask: Callable[[], Frame], now: Occasion) -> Frame:
        """Return a frame that shows the arm alone."""
        now.tell()
        frame = ask()
        return replace(frame, visible=np.zeros_like(frame.visible))


@dataclass(frozen=True)
class DepthMissing(Effect):
    """No detection can be localized."""

    name: ClassVar = "no_depth"

    def locate(self, ask: Callable[[], Array], now: Occasion) -> Array:
        """Raise NoDepth."""
        del ask
        now.tell()
        raise NoDepth("the frame has no depth there, as the test wants it")


def workspace_hidden() -> Effect:
    """The arm hides everything from the camera while it lasts: `Detect` is `hidden`, or sees nothing."""
    return WorkspaceHidden()


def no_depth() -> Effect:
    """No detection can be localized while it lasts: `Localize` fails with `no_depth`."""
    return DepthMissing()
