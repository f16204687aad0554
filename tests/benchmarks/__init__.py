"""Timings: `make bench`. Never run by the tests; ratios are taken in one run because machines are noisy."""
