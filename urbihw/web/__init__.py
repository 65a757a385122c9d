"""The gateway for browsers: HTTP and one WebSocket protocol (docs/gateway.md), in a process beside the daemon.

It is a client of the daemon, by one connection to port 54000 for each browser, and of the control socket of the bus
worker, so that stop, emergency stop, state and plots of devices work while the interpreter is busy.

Reading order: ``settings``, ``gateway`` (what runs), ``connections`` (TCP), ``pages`` and ``guards`` (HTTP),
``pairing`` (who may come in), ``session`` (one browser) with ``outbox`` (what it has not read yet), ``browser_lease``
(how long it may say nothing) and ``verbs`` (what it may ask), ``lobby`` (a connection to the daemon), ``worker`` (what
the control socket tells), ``remote`` (a robot of another machine), ``robot`` (state, devices and tree for all
browsers), ``tree`` (what may be read, written and called).

Requests: ``asked`` (their fields), ``language``, ``moving`` with ``travel`` (how long an order was on its way),
``streams``, ``pictures``. ``serving`` runs it all.

May import the client side (``urbihw.client``), the state folder and the certificate of the daemon, and the verdict on
the health of a robot.  It never imports the kernel or a platform.  Needs the extra ``web``.
"""
