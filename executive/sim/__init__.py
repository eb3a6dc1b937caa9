"""The PyBullet work cell."""
