"""What all robots have in common in urbiscript: the standard robot API (manual, chapter 22) and telemetry.

The modules are those of a library (``urbihw.kernel.stdlib`` tells what they may have):

- ``interface`` (kinds of devices and the slots that these promise), ``localizer`` and ``component`` (the tree of the
  robot), ``mobile`` (speeds and paths of a base);
- ``subscription`` (samples at a rate, by ``sampling``, ``value_feed`` and ``binary_feed``), ``answers`` (for programs),
  ``robot_tree`` (for panels), ``overview`` (for programs), ``device_slots`` (for ``help``) and
  ``figures`` (where the parts of the robot are); they read slots by
  ``slot_reading``, walk the tree by ``tree_walk``, and write texts by ``json_text`` and ``nested_text``.

A kernel that has it is made by ``Kernel(libraries=(ROBOT_LIBRARY,))``.  Start reading with ``interface.u``.  Imports
nothing of the kernel but its door for libraries, ``urbihw.kernel.library``, and ``urbihw.figure``.

``interface_notes`` has the meanings of promised slots.
"""

from urbihw.kernel.library import Library

__all__ = ["ROBOT_LIBRARY"]

ROBOT_LIBRARY = Library(
    "urbihw.robot",
    (
        "subscription", "robot_tree", "overview", "figures", "device_slots", "answers", "interface", "localizer",
        "component", "mobile",
    ),  # fmt: skip
)
"""The library of robots; its modules in the order of loading."""
