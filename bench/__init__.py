"""What urbihw costs, beside plain Python and the other drivers: each module is a bench, `python -m bench.NAME`."""
