"""Measures of standard manoeuvres, recorded or simulated: arrays in, named numbers out."""
