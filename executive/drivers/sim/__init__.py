"""Driver of the simulated cell."""

import executive.physics  # noqa: F401, the import of PyBullet prints no banner there
