"""Fake cell: a kinematic cell without physics, for tests and rehearsals."""
