"""The protocol of remote UObjects (devices in other processes): the server's side and the devices' side.

Reading order: ``external`` (the functions that a remote calls at the server) and ``connection`` (one remote as the
server sees it), with ``subscriptions`` (its variables and events), ``binarymode`` (frames instead of text) and
``external_text`` (messages to the remote); ``mirror`` and ``bridge`` (the server as the devices see it), with
``announce`` and ``outbox`` (messages to the server) and ``wire_values``; ``remote`` and ``frames`` (encoding and
decoding); ``rtp_control``, ``rtp``, ``rtplink`` and ``udp`` (values by RTP).  May import ``uobject``, ``runtime`` and
``sched``.
"""
