"""What a record says it was made with."""

from __future__ import annotations

import platform

from executive.plugins import DISTRIBUTION, find_version, list_requirements, list_versions


def test_names_this_project_python_and_every_package_asked_for_but_no_extras() -> None:
    found = list_versions()
    assert found[DISTRIBUTION] == find_version(DISTRIBUTION) != ""
    assert found["python"] == platform.python_version()
    assert set(list_requirements()) <= set(found)
    assert {"py-trees", "pybullet", "ruckig"} <= set(list_requirements())
    assert not {"viser", "torch"} & set(list_requirements())
    assert find_version("a-package-that-nobody-wrote") == ""
    assert set(list_requirements("view")) == {"viser", "aiohttp"}
    assert list_requirements("nothing") == ()
    assert "torch" in list_requirements("train")


def test_markers_decide_what_is_asked_for(monkeypatch):
    lines = ["a>=1", "b; python_version < '3.0'", "c<2; python_version >= '3.10'", "d[x]; extra == 'view'"]
    monkeypatch.setattr("executive.plugins.metadata.requires", lambda name: lines)
    assert list_requirements() == ("a", "c")
    assert list_requirements("view") == ("d",)
