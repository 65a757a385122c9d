"""Notebooks of Jupyter whose cells are urbiscript, run by a daemon (docs/notebooks.md).

Reading order: ``spec`` (the file by which Jupyter finds it), ``cells`` (what a cell is, and how values are shown),
``kernel`` (the messages of Jupyter).  Only ``kernel`` imports the package ipykernel, of the extra ``jupyter``.
"""
