"""Fake cell: a kinematic cell without physics, for tests of missions and skills."""
