"""From a detection to a point in the world: by known height, by depth image, by the simulator's ray."""
