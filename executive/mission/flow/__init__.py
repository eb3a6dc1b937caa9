"""An abstract run of the tree over every way it can go."""
