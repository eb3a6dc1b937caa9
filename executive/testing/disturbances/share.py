"""How much of a motion the arm has behind it when something happens."""

from __future__ import annotations

from executive.errors import InputError


def checked_share(share: float) -> float:
    """Return a share of a motion that the arm passes through.

    Raises:
        InputError: It is not more than 0 and less than 1.
    """
    if not 0.0 < share < 1.0:
        raise InputError(f"a share of a motion is more than 0 and less than 1, not {share:g}")
    return share
