"""Blackboard of py_trees with the data of one run.

py_trees has one blackboard per process, in class attributes of `Blackboard`. Two runs in one process must not
share data, so the class attributes are exchanged whenever code of a behaviour is executed.
"""

from __future__ import annotations

import threading
from weakref import WeakKeyDictionary

from py_trees.blackboard import Blackboard

from executive.cell.protocols import BehaviourStep, Clock

PORT_PREFIX = "/ports of behaviours/"
"""Start of the keys of ports on the blackboard."""
_LOCK = threading.RLock()
"""Lock on the class attributes of `Blackboard`, because another thread may execute another run."""
_STORAGE_BY_CLOCK: WeakKeyDictionary[Clock, dict[str, object]] = WeakKeyDictionary()
"""Values of the blackboard of each run, by the clock of the run: every run has exactly one clock."""


class RunBlackboard:
    """Context manager; in the `with` block, the blackboard of py_trees contains the data of one run.

    The values belong to the run. The clients and the metadata of keys belong to this object and are discarded
    with it, so that no client of a discarded behaviour remains.

    Args:
        clock: Clock of the run.

    Attributes:
        storage: Values by key.
    """

    def __init__(self, clock: Clock) -> None:
        self.storage = _STORAGE_BY_CLOCK.setdefault(clock, {})
        self._attributes = {"storage": self.storage, "metadata": {}, "clients": {}, "activity_stream": None}

    @property
    def shared_values(self) -> dict[str, object]:
        """Copy of the values by key, without the ports, each of which belongs to one behaviour."""
        return {key: value for key, value in self.storage.items() if not key.startswith(PORT_PREFIX)}

    def restore(self, step: BehaviourStep) -> BehaviourStep:
        """Replace the shared values by those of a step, which a replay did not execute; return the step."""
        for key in self.shared_values:
            del self.storage[key]
        self.storage.update({key: value for key, value in step.values.items() if key.startswith("/")})
        return step

    def __enter__(self) -> None:
        _LOCK.acquire()
        self._swap_attributes()

    def __exit__(self, *_: object) -> None:
        self._swap_attributes()
        _LOCK.release()

    def _swap_attributes(self) -> None:
        """Exchange the class attributes of `Blackboard` with the attributes of this object."""
        for name, value in self._attributes.items():
            self._attributes[name] = getattr(Blackboard, name)
            setattr(Blackboard, name, value)
