"""From windows to better models: a compensator, its training, its tuning."""
