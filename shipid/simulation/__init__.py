"""Simulated runs: manoeuvres, weather, sea and sensors, and the truth of a study."""
