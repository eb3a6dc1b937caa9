"""Entry point of the server process of the live page, which has a lower priority than the run."""

from __future__ import annotations

import os

if __name__ == "__main__":
    os.nice(5)  # The tick loop of the run has precedence.

    from executive.view.live.program import main

    main()
