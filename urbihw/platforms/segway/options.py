"""The options of a Segway: ``[options]`` in ``urbihw.toml``."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from urbihw.frozen import frozen
from urbihw.navigation.options import DrivenBaseOptions
from urbihw.settings import TEXT, Mistake, choice, setting

MODELS: Final = ("50", "100", "200", "400")


@frozen(slots=False)
class SegwayOptions(DrivenBaseOptions):
    """The options, beside those of navigation.

    Attributes:
        model: of the RMP: 50, 100, 200 or 400.
        second_channel: the url of the base's other CAN bus, such as "can://socketcan/can1"; "" for none.
        second_base: the url of the other half of an RMP 400, which gets the same commands; "" for none.
    """

    model: str = setting("200", choice(*MODELS, *map(int, MODELS), wants=f"one of {', '.join(MODELS)}", make=str))
    second_channel: str = setting("", TEXT)
    second_base: str = setting("", TEXT)

    def clashes(self) -> Iterator[Mistake]:
        """Yield a second channel beside a second base, and what is wrong with the laser."""
        yield from super().clashes()
        if self.second_channel and self.second_base:
            yield Mistake("second_channel", "second_base is set too; the halves of an RMP 400 have one channel each")
