"""The commands ``urbihw`` and ``urbi``: one module for each subcommand.  Start at ``main``; may import all but
fakes."""
