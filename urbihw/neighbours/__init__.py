"""Good neighbours: what other people's programs, with protocols of their own, see of a robot.

Each is a client of the daemon, by the client library: so limits, leases, emergency stop and the reasons that ``why``
tells hold for it as for any client.  None opens a wire, none has a way of its own into the kernel, and each needs an
extra, so that the base install stays small.

- ``assistant``: assistants (MCP), ``urbihw mcp``;
- ``notebook``: a kernel of Jupyter, ``urbihw jupyter``;
- ``home``: Home Assistant and others, by MQTT, ``urbihw mqtt``;
- ``editor``: a language server, ``urbihw lsp``.

``orders`` is how those of them move a robot that do it for somebody else.

May import the client library, how an extra is installed, and the parser of urbiscript; never another part of the
kernel, a bus, a platform or the daemon.
"""
