"""PyBullet model of arm, tool, table and bins. The import of pybullet prints no banner on stderr."""

import contextlib
import os
from importlib import import_module

with contextlib.ExitStack() as _restoration:
    with contextlib.suppress(OSError):  # stderr is closed: nothing can be written to it.
        _saved_stderr = os.dup(2)
        _restoration.callback(os.close, _saved_stderr)
        _restoration.callback(os.dup2, _saved_stderr, 2)
        _null_device = os.open(os.devnull, os.O_WRONLY)
        os.dup2(_null_device, 2)
        os.close(_null_device)
    import_module("pybullet")
