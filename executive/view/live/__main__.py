"""Process of the live page, with a lower priority than the run."""

from __future__ import annotations

import os

if __name__ == "__main__":
    os.nice(5)  # Lower the priority: the tick loop of the run goes first.

    from executive.view.live.program import main

    main()
