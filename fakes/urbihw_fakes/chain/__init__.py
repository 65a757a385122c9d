"""Simulated chains of servos: `parts` (units by the names of their models) and `start`."""
