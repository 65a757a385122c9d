"""Sabotages that the tests must notice: `table` reads the rows, `run` plays them."""
