"""The process of the live page, which stands back behind the run before it loads anything."""

from __future__ import annotations

import os

if __name__ == "__main__":
    os.nice(5)  # The tick loop goes first.

    from executive.view.live.program import main

    main()
