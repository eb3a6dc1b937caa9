"""The PyBullet work cell; importing it loads pybullet without the greeting that pybullet prints on stderr."""

import os
from importlib import import_module


def _load_without_greeting() -> None:
    try:
        kept = os.dup(2)
    except OSError:  # stderr is closed: nothing can be written to it
        import_module("pybullet")
        return
    nowhere = os.open(os.devnull, os.O_WRONLY)
    try:
        os.dup2(nowhere, 2)
        import_module("pybullet")
    finally:
        os.dup2(kept, 2)
        os.close(kept)
        os.close(nowhere)


_load_without_greeting()
