"""Simulated runs: manoeuvres, wind, sea and sensors, and the simulated truth of a study."""
