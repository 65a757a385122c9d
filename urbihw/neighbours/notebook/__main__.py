"""The program that Jupyter starts: ``python -m urbihw.neighbours.notebook -f FILE``."""

from urbihw.neighbours.notebook.kernel import main

main()
