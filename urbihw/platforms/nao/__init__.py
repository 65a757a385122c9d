"""The Nao of Aldebaran: joints, hands, walking, lights, sensors and speech, through NAOqi 2.

Reading order: ``platform.toml``, ``reading`` (what is read of ALMemory), ``orders`` (what is written to joints),
``finding`` (what there is), ``exchange`` and ``part`` (what the parts of the driver share), ``joint_part``, ``walk_part``,
``light_part``, ``sense_part``, ``call_part``, ``driver`` (who speaks to NAOqi, in the worker's process, by
``urbihw.buses.qi``), ``robot`` with ``joints`` and ``devices`` (the objects of urbiscript), ``nao.u`` (proxies of
services), ``tree.u`` (the standard robot API, groups).
"""
