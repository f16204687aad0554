"""A campaign of faults, drawn by seed: `make faults`, or `python -m tests.faults --scale 5`."""
