"""Modules drawn at random over all packages, for readers who measure how understandable the code is."""

from __future__ import annotations

import argparse
import random
from pathlib import Path

ROOT = Path(__file__).parents[2]
MIN_LINES = 15
"""Minimum number of lines of a module that is drawn."""


def draw_modules(seed: int, count: int, skipped: frozenset[str] = frozenset()) -> list[str]:
    """Return the paths of `count` modules of `executive/` and `skills/` that are not in `skipped`."""
    modules = [
        str(path.relative_to(ROOT))
        for root in ("executive", "skills")
        for path in (ROOT / root).rglob("*.py")
        if len(path.read_text().splitlines()) >= MIN_LINES
    ]
    return sorted(random.Random(seed).sample(sorted(set(modules) - skipped), count))


def main() -> None:
    """Print the paths of the drawn modules, one per line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--count", type=int, default=20)
    parser.add_argument("--skip", type=Path, help="file with the paths of modules that are not drawn")
    options = parser.parse_args()
    skipped = frozenset(options.skip.read_text().split()) if options.skip else frozenset()
    print(*draw_modules(options.seed, options.count, skipped), sep="\n")


if __name__ == "__main__":
    main()
