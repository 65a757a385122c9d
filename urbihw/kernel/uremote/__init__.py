"""Devices of other processes: the protocol of remote UObjects, as the server speaks it and as the devices' side does.

Reading order: ``external`` (the words that a remote says to the server) and ``connection`` (one remote as the server
sees it), with ``subscriptions`` (what it hears of), ``binarymode`` (frames instead of words) and ``external_text``
(what it is sent); ``mirror`` and ``bridge`` (the server as the devices see it), with ``announce`` and ``outbox`` (what
they say) and ``wire_values``; ``remote`` and ``frames`` (the bytes between them); ``rtp_control``, ``rtp``,
``rtplink`` and ``udp`` (values by RTP).
May import ``uobject``, ``runtime`` and ``sched``.
"""
