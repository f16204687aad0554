"""Datasets of runs, windows cut from them, and checks: what every method and study sees."""
