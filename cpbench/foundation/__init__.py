"""Parts that everything stands on: arrays and cones, files and processes, text."""
