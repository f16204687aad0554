"""From equations to trajectories: rollouts on CasADi or lowered to PyTorch, manoeuvres and the simulated truth."""
