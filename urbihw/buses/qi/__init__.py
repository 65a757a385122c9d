"""QiMessaging, the protocol of NAOqi 2.x: typed calls, signals and properties of services, over one connection.

Where to start: ``signatures`` (how types are written), ``values`` (their bytes), ``frames`` (header and framing),
``metaobject`` (what a service offers), ``session`` (log in, find services, call them), ``link`` (``qi://`` and
``qis://``).  Written from the description of the wire; libqi is not needed.
"""
