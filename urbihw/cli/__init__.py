"""The commands ``urbihw`` and ``urbi``: one module a subcommand.  Start at ``main``; may import all but fakes."""
