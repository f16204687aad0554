"""System identification: vessel parameters fitted to recorded runs, their uncertainty and identifiability."""
