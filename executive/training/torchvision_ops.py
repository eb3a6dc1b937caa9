"""Declaration of torchvision's operators, for a torch that torchvision was not built for.

With a CPU build of torch and the default build of torchvision, the compiled part of torchvision does not
load, and its Python part raises an error at the missing operators. The training calls none of these
operators: their declaration is enough.
"""

from __future__ import annotations

import functools

OPERATORS = ("nms", "qnms")


@functools.cache
def declare_missing() -> object | None:
    """Declare torchvision's operators if its compiled half does not load; call before importing it.

    Returns:
        The library that keeps the declarations alive, or None.
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
