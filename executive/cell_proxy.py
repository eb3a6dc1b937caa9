"""Proxy between a skill and its cell: one interceptor gets every question and every command.

The tape records and replays through it, the test kit watches through it, and fault scripts change answers
through it. Proxies can be nested: the cell that `intercept` returns can be intercepted again.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any

from executive.arm import Arm, Planning
from executive.cell import Camera, Cell, Detector, Ledger, Localizer, Operator, Request, Tool

_PROTOCOLS: Mapping[str, type] = {
    "arm": Arm,
    "plan": Planning,
    "tool": Tool,
    "camera": Camera,
    "detector": Detector,
    "request": Request,
    "ledger": Ledger,
    "operator": Operator,
    "localizer": Localizer,
}
_RETURNED = {"arm.plan": "plan", "detector.request": "request"}
"""Roles of the objects that a call returns and that are asked later."""

METHODS: Mapping[str, Mapping[str, bool]] = {
    role: {name: callable(member) for name, member in vars(protocol).items() if not name.startswith("_")}
    for role, protocol in _PROTOCOLS.items()
}
"""Members of every part of a cell by its role: True for a method, False for an attribute."""


@dataclass(frozen=True)
class Access:
    """One read of an attribute, or one call of a method, of a part of a cell.

    Attributes:
        role: Role of the part: `arm`, `tool`, `detector`, ..., `plan` or `request`.
        key: Name of the detector that was asked; "" for every other part.
        member: Name of the attribute or method.
        proceed: Asks the part itself and returns its answer.
        arguments: Arguments of the call by position.
        named: Arguments of the call by name.
    """

    role: str
    key: str
    member: str
    proceed: Callable[[], Any]
    arguments: tuple[Any, ...] = ()
    named: Mapping[str, Any] = field(default_factory=dict)

    @cached_property
    def name(self) -> str:
        """Role and member: `arm.start`."""
        return f"{self.role}.{self.member}"

    @property
    def values(self) -> tuple[Any, ...]:
        """All arguments, those by name last."""
        return (*self.arguments, *self.named.values())

    @property
    def is_call(self) -> bool:
        """True for the call of a method, False for the read of an attribute."""
        return METHODS[self.role][self.member]


Interceptor = Callable[[Access], Any]
"""Returns the answer to an access: that of `proceed`, or another one."""


def intercept(cell: Cell, interceptor: Interceptor, roles: Collection[str]) -> Cell:
    """Return the cell with every access to the parts of these roles going through the interceptor.

    So does every access to the plannings and requests that these parts return.
    """
    parts: dict[str, Any] = {
        role: _Proxy(role, "", getattr(cell, role), interceptor) for role in roles if role != "detector"
    }
    if "detector" in roles:
        parts["detectors"] = {
            key: _Proxy("detector", key, one, interceptor) for key, one in cell.detectors.items()
        }
    return replace(cell, **parts)


class _Proxy:
    """A part of a cell that offers the members of its protocol, each through an interceptor.

    The part may be None if the interceptor never proceeds.
    """

    def __init__(self, role: str, key: str, part: Any, interceptor: Interceptor) -> None:
        self._role, self._key, self._part, self._intercept = role, key, part, interceptor
        self._reads: dict[str, Access] = {}

    def __getattr__(self, member: str) -> Any:
        if member.startswith("_") or member not in METHODS[self._role]:
            # Underscores first: a copy that is being made has no role yet.
            raise AttributeError(f"{type(self).__name__} has no attribute {member!r}")
        if METHODS[self._role][member]:
            return partial(self._call, member)
        if member not in self._reads:
            self._reads[member] = Access(self._role, self._key, member, partial(getattr, self._part, member))
        return self._intercept(self._reads[member])

    def _call(self, member: str, /, *arguments: Any, **named: Any) -> Any:
        def proceed() -> Any:
            return getattr(self._part, member)(*arguments, **named)

        access = Access(self._role, self._key, member, proceed, arguments, named)
        answer = self._intercept(access)
        if returned := _RETURNED.get(access.name):
            return _Proxy(returned, self._key, answer, self._intercept)
        return answer
