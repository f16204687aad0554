"""Vessels: read a document, perturb it, assemble its equations of motion."""
