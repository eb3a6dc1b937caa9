"""Let torchvision import beside a torch it was not built for.

A CPU build of torch beside the default torchvision is a common pair. The compiled half of torchvision
then does not load, and its Python half stops at the operators it cannot find. Training here calls none
of them, so it is enough that they are declared.
"""

from __future__ import annotations

import functools

OPERATORS = ("nms", "qnms")


@functools.cache
def declare_missing() -> object | None:
    """Declare torchvision's operators if its compiled half does not load; call before importing it.

    Returns:
        The library that holds the declarations for as long as the process lives, or None.

    """
    import importlib.util
    from pathlib import Path

    import torch

    package = importlib.util.find_spec("torchvision")
    if package is None or package.origin is None:
        return None
    try:
        torch.ops.load_library(str(next(Path(package.origin).parent.glob("_C*"))))
    except (OSError, ImportError, StopIteration):
        library = torch.library.Library("torchvision", "DEF")
        for name in OPERATORS:
            library.define(f"{name}(Tensor dets, Tensor scores, float iou_threshold) -> Tensor")
        return library
    return None
