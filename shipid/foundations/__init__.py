"""Foundations that others bring: simulators that shipid runs, and does not write."""
