"""From a goal to a motion of the arm: kinematics, what stands around, the search, the seal, braking."""
