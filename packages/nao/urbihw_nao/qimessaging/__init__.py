"""QiMessaging, the protocol of NAOqi 2.x: typed calls, signals and properties of services.

Where to start: ``session`` (what a session can do), then its two back ends.

Ours needs nothing but Python: ``signatures`` (how types are written), ``values`` (their bytes), ``frames`` (header and
framing), ``metaobject`` (what a service offers), ``link`` (``qi://`` and ``qis://``), ``login``, ``connection`` (calls
and events on one link), ``endpoints`` (where services live), ``wire_session``.  It is written from the description of
the wire.

``libqi`` with ``libqi_values`` is the other one, over Aldebaran's library.  ``opening`` chooses by the port.

Objects of ours, called by others: ``serving`` (what they offer), ``visitors`` (connections that others make to us),
``hosting`` (their registration in the robot's directory).

Beside them: ``metatype`` (signatures of the protocol), ``checked``, ``call_limits`` and ``login_guard`` (bounds for the
other side), ``trace``.
"""
