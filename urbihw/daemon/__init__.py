"""The daemon: one process that owns a robot and serves it to all clients.

Reading order: ``service`` (start, reload, stop), ``config`` (its settings), ``access_policy`` and ``access`` (TLS and
tokens for clients of other machines), ``notify`` (messages to the service manager), ``fake`` (the process of the
simulated robot), ``holders`` (the process that has the port or the device open).

The service manager and the system: ``activation``, ``units``, ``journal``, ``timeouts``, ``runtime`` and
``dead_sockets`` (sockets), ``state`` with ``secrets`` and ``tls`` (what is kept), ``files`` and ``schema`` (of the
settings). For those who watch: ``observers``, ``control_client``, ``metrics`` with ``metrics_text``, ``panel``,
``flight``, ``fleet`` and ``ros`` (children of the daemon, by ``kept_child``, which live by ``kept_work``),
``record_feed`` (for recorders), ``announce``.
"""
