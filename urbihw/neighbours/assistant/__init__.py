"""A robot for assistants: a server of the Model Context Protocol (docs/assistants.md), ``urbihw mcp``.

Reading order: ``settings`` (what it may do), ``neighbours.orders`` (one order: a connection and a lease of its own),
``looking`` (what does not move), ``server`` (the tools, as the protocol has them).  Only ``server`` imports the package
``mcp`` of the extra of that name.
"""
