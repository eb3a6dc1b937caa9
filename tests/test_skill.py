"""What a class body declares, and what its author is told of a mistake in it."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from typing import Any

import pytest

from executive.errors import InputError
from executive.skill import Skill, discover, param, port


@pytest.mark.parametrize(
    ("declared", "kind"),
    [(param(2), "int"), (param(0.5), "float"), (param("a"), "str"), (param(True), "bool"), (port(), "int")],
)
def test_what_is_declared_without_an_annotation_is_refused(declared: Any, kind: str) -> None:
    with pytest.raises(TypeError) as raised:
        type("Knock", (Skill,), {"times": declared})
    assert str(raised.value) == (
        "Knock.times has no annotation, so nobody knows its type; write, for instance, "
        f'"times: {kind} = param(...)" for a param, "times: In[...] = port(...)" for an input, '
        '"times: Out[...] = port(...)" for an output'
    )


def test_a_default_that_is_changed_needs_its_annotation_again() -> None:
    class Knock(Skill):
        times: int = param(2)

    with pytest.raises(TypeError, match=r"Louder\.times has no annotation"):
        type("Louder", (Knock,), {"times": param(3)})


def test_a_skill_that_cannot_be_loaded_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = EntryPoint("Knock", "no_such_package.knock:Knock", "executive.skills")
    monkeypatch.setattr("executive.skill.entry_points", lambda group: [entry])
    with pytest.raises(InputError) as raised:
        discover()
    assert str(raised.value) == (
        'the skill "Knock" (no_such_package.knock:Knock) cannot be loaded: ModuleNotFoundError: No module '
        "named 'no_such_package'. Mend it, or uninstall its package; `executive --debug ...` shows where it "
        "happens"
    )
