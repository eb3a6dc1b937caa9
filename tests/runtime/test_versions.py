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
