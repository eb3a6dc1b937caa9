"""Proxies of the parts of a cell, which pass each attribute read and each call to an interceptor.

The input recorder, the replay, the test kit and the fault scripts intercept calls with these proxies.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

from executive.cell import protocols
from executive.cell.arm import Arm, Planning
from executive.cell.protocols import Cell

_PROTOCOLS: Mapping[str, type] = {
    "arm": Arm,
    "plan": Planning,
    "tool": protocols.Tool,
    "camera": protocols.Camera,
    "detector": protocols.Detector,
    "request": protocols.Request,
    "ledger": protocols.Ledger,
    "operator": protocols.Operator,
    "localizer": protocols.Localizer,
    "behaviours": protocols.Behaviours,
}
"""Protocol by role: role of a part of the cell, or of an object that a part returns."""
_RETURNED_ROLES = {"arm.plan": "plan", "detector.request": "request"}
"""Role of the object that a call returns, by `Access.name`; the caller receives a proxy of the object."""

IS_METHOD: Mapping[str, Mapping[str, bool]] = {
    role: {name: callable(member) for name, member in vars(protocol).items() if not name.startswith("_")}
    for role, protocol in _PROTOCOLS.items()
}
"""True for each method and False for each attribute, by role and member name."""


@dataclass(frozen=True)
class Access:
    """One read of an attribute, or one call of a method, of a part of a cell.

    Attributes:
        role: Role of the part, a key of `IS_METHOD`: `arm`, `tool`, `detector`, `request`, ...
        detector: Name of the detector for the roles `detector` and `request`, otherwise "".
        member: Name of the attribute or method.
        proceed: Function that performs the access on the part itself and returns the result.
        arguments: Positional arguments of the call, then the values of its keyword arguments; () for an
            attribute.
    """

    role: str
    detector: str
    member: str
    proceed: Callable[[], Any]
    arguments: tuple[Any, ...] = ()

    @cached_property
    def name(self) -> str:
        """Role and member, for instance `arm.start`."""
        return f"{self.role}.{self.member}"

    @property
    def is_call(self) -> bool:
        """True for the call of a method, False for the read of an attribute."""
        return IS_METHOD[self.role][self.member]


Interceptor = Callable[[Access], Any]
"""Handles an access and returns its result: the result of `access.proceed()`, or a substitute."""


def intercept(cell: Cell, interceptor: Interceptor, roles: Collection[str]) -> Cell:
    """Return a copy of the cell in which the interceptor handles each access to the parts in `roles`.

    The interceptor also handles accesses to `Planning` and `Request` objects that these parts return.
    """
    parts: dict[str, Any] = {}
    for role in set(roles) - {"detector"}:
        parts[role] = _Proxy(role, "", getattr(cell, role), interceptor)
    if "detector" in roles:
        detectors = cell.detectors.items()
        parts["detectors"] = {name: _Proxy("detector", name, part, interceptor) for name, part in detectors}
    return replace(cell, **parts)


class _Proxy:
    """Proxy of a part of a cell, with the members of the protocol of the part.

    The part may be None if the interceptor never calls `Access.proceed`.
    """

    def __init__(self, role: str, detector: str, part: Any, interceptor: Interceptor) -> None:
        self._role = role
        self._detector = detector
        self._part = part
        self._intercept = interceptor
        self._attribute_accesses: dict[str, Access] = {}
        """Accesses by attribute name, stored because attributes are read in every control step."""

    def __getattr__(self, member: str) -> Any:
        if member.startswith("_") or member not in IS_METHOD[self._role]:
            # The underscore is tested first: `copy` reads private names before `_role` has a value.
            raise AttributeError(f"{type(self).__name__} has no attribute {member!r}")
        if IS_METHOD[self._role][member]:
            return partial(self._call, member)
        if member not in self._attribute_accesses:
            proceed = partial(getattr, self._part, member)
            self._attribute_accesses[member] = Access(self._role, self._detector, member, proceed)
        return self._intercept(self._attribute_accesses[member])

    def _call(self, member: str, /, *arguments: Any, **keywords: Any) -> Any:
        def proceed() -> Any:
            return getattr(self._part, member)(*arguments, **keywords)

        access = Access(self._role, self._detector, member, proceed, (*arguments, *keywords.values()))
        result = self._intercept(access)
        if returned_role := _RETURNED_ROLES.get(access.name):
            return _Proxy(returned_role, self._detector, result, self._intercept)
        return result
