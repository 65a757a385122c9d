"""Text to nodes and back: the syntax of urbiscript.  Imports nothing else of urbihw.

Reading order:

- ``location`` and ``ast``: positions, and the classes of nodes; ``binding``: what the compiler stores on nodes.
- ``urbiscript.lark``: the grammar, the whole language on a few screens.
- ``reader``: bytes of a connection in, statements and syntax errors out.  ``StatementReader`` and ``parse_program``
are what
  the rest of the kernel calls.
- ``source`` keeps the characters and their positions; ``lexer`` splits them into tokens, with the words and signs of
  ``tokens``.
- ``parser`` is the machine that runs the grammar and recovers from errors; ``statements`` and ``expressions`` make the
  nodes, one function per rule, found by its name (``rules``); ``tables`` lets lark compute the tables of the machine
  once.
- ``check``: the syntax errors that the grammar does not detect.
- ``pace``: lets long work, here and in the compiler, yield to other jobs.
- ``printer``: nodes to urbiscript, as the server shows functions and failed assertions.
- ``chains`` divides long rows of writes; ``hints`` and ``advice``: likely causes of a syntax error, and what to write;
  ``cache_folder``: tables and code kept from one start to the next.
"""
