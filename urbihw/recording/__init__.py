"""Recordings: one MCAP file with what happened on a robot's wire and to its devices, and what is done with it.

docs/recording.md tells what is in a file. A recorder is a process of its own. It reads the control socket of the bus
worker (verb ``record``), as the gateway and the metrics do: it needs no interpreter, and the worker waits for nothing.

    worker --socket--> feed --queue--> records --> recording_file (a file) and flight (the last minutes in memory)

Each arrow is bounded. What does not fit is dropped, the oldest first, counted, and written into the file as a number.

Where to start: ``records`` (events of the worker -> records of a topic; no I/O), ``topics`` (their names and schemas),
``feed`` (reads the socket in a thread), ``recording_file`` (writes a file that survives the death of its process),
``flight`` and ``flight_recorder`` (the last minutes, and when they are written), ``recorder`` (puts them together),
``door`` (how a recorder is asked). What others have written is read by ``reading``, which bounds what a hostile file
may cost. For people: ``showing`` (records as lines), ``reasons`` (why a device did what it did), ``table`` (CSV),
``drawing`` (curves). ``wire`` makes a capture of a recording, which a simulated robot plays.

May import: ``urbihw.buses``, ``urbihw.control_line``, ``urbihw.extras``, ``urbihw.backoff``.
"""
