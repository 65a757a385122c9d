"""The options of a Segway: ``[options]`` in ``urbihw.toml``."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from urbihw.navigation.options import DrivenBaseOptions
from urbihw.settings import choice, setting

MODELS: Final = ("50", "100", "200", "400")


@dataclass(frozen=True)
class Options(DrivenBaseOptions):
    """The options, beside those of navigation.

    Attributes:
        model: of the RMP: 50, 100, 200 or 400.
    """

    model: str = setting("200", choice(*MODELS, *map(int, MODELS), wants=f"one of {', '.join(MODELS)}", make=str))
