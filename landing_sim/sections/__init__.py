"""The sections of a scenario file: frozen, checked values with their units in the keys."""
