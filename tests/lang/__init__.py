"""Transcripts of the language: what is typed and what is answered, on a simulated clock.

``transcript`` reads and plays them, ``conftest`` makes a test of each unit, ``run`` writes down what was answered.
"""
