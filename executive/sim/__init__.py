"""The PyBullet work cell."""

from executive.sim import silence as silence
