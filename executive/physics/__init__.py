"""PyBullet model of arm, tool, table and bins. The import of pybullet prints no banner on stderr."""

import os
from importlib import import_module


def _import_without_banner() -> None:
    try:
        saved_stderr = os.dup(2)
    except OSError:  # stderr is closed: nothing can be written to it
        import_module("pybullet")
        return
    null_device = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(null_device, 2)
        import_module("pybullet")
    finally:
        os.dup2(saved_stderr, 2)
        os.close(saved_stderr)
        os.close(null_device)


_import_without_banner()
