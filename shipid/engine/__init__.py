"""Rollouts: the integrator, and the engines that run it (CasADi, C on SIMD vectors, PyTorch)."""
