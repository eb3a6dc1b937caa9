"""What a record says it was made with."""

from __future__ import annotations

import platform

from executive.run.versions import installed, required, versions


def test_names_this_project_python_and_every_package_asked_for_but_no_extras() -> None:
    found = versions()
    assert found["executive"] == installed("executive") != ""
    assert found["python"] == platform.python_version()
    assert set(required()) <= set(found)
    assert {"py-trees", "pybullet", "ruckig"} <= set(required())
    assert not {"viser", "torch"} & set(required())
    assert installed("a-package-that-nobody-wrote") == ""
    assert (set(required("view")), required("nothing")) == ({"viser", "aiohttp", "trimesh"}, ())
    assert "torch" in required("train")


def test_markers_decide_what_is_asked_for(monkeypatch):
    lines = ["a>=1", "b; python_version < '3.0'", "c<2; python_version >= '3.10'", "d[x]; extra == 'view'"]
    monkeypatch.setattr("executive.run.versions.metadata.requires", lambda name: lines)
    assert required() == ("a", "c")
    assert required("view") == ("d",)
