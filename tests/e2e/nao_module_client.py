"""A client of libqi that calls the module mathematics of the Nao at a url, for ``test_nao_module_clients``."""

from __future__ import annotations

import sys

import qi

session = qi.Session()
session.connect(sys.argv[1])
module = session.service("mathematics")
print("told sum", module.add(2, 3), module.add("a", "b"), module.add([1], [True]))
print("told ping", module.ping())
print("told help", module.getMethodHelp("add"))
meta = module.metaObject()
(add,) = [row for row in meta["methods"].values() if row["name"] == "add"]
print("told meta", meta["description"], add["description"], [row["name"] for row in add["parameters"]])
calls = [module.add(number, 1, _async=True) for number in range(10)]
print("told many", [call.value() for call in calls])
for name, arguments in (("add", (1, [])), ("exit", ()), ("hang", ())):
    try:
        getattr(module, name)(*arguments)
    except RuntimeError as error:
        print("told error", *str(error).splitlines())
session.close()
