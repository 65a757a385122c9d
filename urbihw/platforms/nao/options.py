"""What the settings may say of a Nao: ``[options]`` in ``urbihw.toml``."""

from __future__ import annotations

from dataclasses import dataclass, field

from urbihw.settings import TEXT, Table, number, setting


@dataclass(frozen=True)
class Options(Table):
    """The options.

    Attributes:
        user: who logs in to NAOqi, "" for a robot that asks nobody.
        password: of that user; it travels in clear over ``qi://``, and is never logged.
        fraction: of its greatest speed at which a joint goes to its goal, 0.01 to 1.
    """

    user: str = setting("", TEXT)
    password: str = field(default="", repr=False, metadata={"rule": TEXT, "in_url": False})
    fraction: float = setting(1.0, number(0.01, 1.0))
