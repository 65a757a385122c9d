"""The Nao of Aldebaran: joints, hands, walking, lights, sensors and speech, through NAOqi 2.

Reading order: ``platform.toml``, ``reading`` (what is read of ALMemory), ``orders`` (what is written to joints),
``finding`` (what there is), ``driver`` (who speaks to NAOqi, in the worker's process, by ``urbihw.buses.qi``),
``robot`` with ``joints`` and ``devices`` (the objects of urbiscript), ``nao.u`` (proxies of services), ``tree.u`` (the
standard robot API, groups).
"""
