"""Special kinematics of arms, which arm files name as their solver: entry points `executive.ik_solvers`."""
