"""What a record says it was made with."""

from __future__ import annotations

import platform

from executive.runtime.versions import installed, required, versions


def test_names_this_project_python_and_every_package_asked_for():
    found = versions()
    assert found["executive"] == installed("executive") != ""
    assert found["python"] == platform.python_version()
    assert set(required()) <= set(found)
    assert {"py-trees", "pybullet", "ruckig"} <= set(required())


def test_extras_are_not_asked_for():
    assert not {"viser", "torch", "tomli"} & set(required())


def test_what_is_not_installed_has_no_version():
    assert installed("a-package-that-nobody-wrote") == ""


def test_what_an_extra_adds_is_told_apart():
    assert set(required("view")) == {"viser", "aiohttp", "trimesh"}
    assert "torch" in required("train")
    assert not {"torch", "pybullet"} & set(required("view"))
    assert required("nothing") == ()


def test_markers_decide_what_is_asked_for(monkeypatch):
    lines = ["a>=1", "b; python_version < '3.0'", "c<2; python_version >= '3.10'", "d[x]; extra == 'view'"]
    monkeypatch.setattr("executive.runtime.versions.metadata.requires", lambda name: lines)
    assert required() == ("a", "c")
    assert required("view") == ("d",)
