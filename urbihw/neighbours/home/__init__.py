"""A robot in a home: its state by MQTT, as Home Assistant discovers it (docs/homes.md), ``urbihw mqtt``.

Reading order: ``settings``, ``things`` (what the broker gets: names, units, discovery), ``orders_in`` (what of the
broker's messages is an order, and the newest of each joint), ``bridge`` (the connections).  Only ``bridge`` imports the
package aiomqtt, of the extra ``mqtt``.
"""
