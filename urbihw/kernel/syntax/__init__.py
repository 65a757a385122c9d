"""Text to nodes and back: the syntax of urbiscript.  Imports nothing else of urbihw.

Reading order:

- ``location`` and ``ast``: where things stand, and every node; ``binding``: what the compiler keeps on nodes.
- ``urbiscript.lark``: the grammar, the whole language on a few screens.
- ``reader``: bytes of a connection in, statements and syntax errors out.  ``Reader`` and ``parse_program`` are what
  the rest of the kernel calls.
- ``source`` holds the characters and knows where they stand; ``lexer`` cuts them into tokens, with the words and
  signs of ``tokens``.
- ``parser`` is the machine that runs the grammar, and how it goes on after an error; ``statements`` and
  ``expressions`` make the nodes, one function per rule, found by its name (``rules``); ``tables`` has lark compute the
  machine's tables once.
- ``check``: what is a syntax error although the grammar accepts it.
- ``pace``: how long work, here and in the compiler, gives way to others.
- ``printer``: nodes to urbiscript, as the server shows functions and failed assertions.
"""
