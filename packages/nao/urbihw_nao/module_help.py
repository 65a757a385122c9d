"""The methods that each NAOqi module has besides its own (fact sheet, section 7, end).

A module has no ``pCall``, ``wait``, ``isRunning`` and ``stop``: clients of NAOqi 2 call without waiting by themselves.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache
from typing import Any, Final

from urbihw_nao.qimessaging.serving import IncomingCall, ServedMethod

BROKER: Final = "urbihw"


def standard_methods(module: str, description: str, own: Sequence[ServedMethod]) -> list[ServedMethod]:
    """They tell of the module and of its ``own`` methods; one that the module has itself is left out."""
    texts = {each.name: each for each in own}

    def help_of(name: str) -> list[Any]:
        """Name, description, parameters with their texts, result.  Raises ValueError."""
        if name not in texts:
            raise ValueError(f"{module} has no method {name}; it has {', '.join(sorted(texts)) or 'none of its own'}")
        each = texts[name]
        return [each.name, each.description, [list(row) for row in each.parameter_texts], each.result_text]

    def refuse_exit(call: IncomingCall) -> None:
        raise ValueError(f"{module} belongs to urbihw, and is ended there")

    def tell_module(call: IncomingCall) -> None:
        call.answer([module, description])

    def tell_method(call: IncomingCall) -> None:
        call.answer(help_of(*call.arguments))

    def tell_usage(call: IncomingCall) -> None:
        call.answer(_usage(module, help_of(*call.arguments)))

    rows: list[tuple[str, str, str, str, Callable[..., None]]] = [
        ("exit", "()", "v", "Refused", refuse_exit),
        ("version", "()", "s", "The version of urbihw", lambda call: call.answer(find_version())),
        ("ping", "()", "b", "True: the module is there", lambda call: call.answer(True)),
        ("getMethodList", "()", "[s]", "The names of its own methods", lambda call: call.answer(list(texts))),
        ("getMethodHelp", "(s)", "m", "Name, description, parameters and result of a method", tell_method),
        ("getModuleHelp", "()", "m", "Name and description of the module", tell_module),
        ("getUsage", "(s)", "s", "How a method is called", tell_usage),
        ("getBrokerName", "()", "s", "The program that has the module", lambda call: call.answer(BROKER)),
    ]  # fmt: skip
    return [
        ServedMethod(name, run, parameters, returns, text)
        for name, parameters, returns, text, run in rows
        if name not in texts
    ]


@cache
def find_version() -> str:
    """The version of urbihw, "" where it is not installed."""
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("urbihw")
    except PackageNotFoundError:
        return ""


def _usage(module: str, help_: Sequence[Any]) -> str:
    name, description, parameters, _ = help_
    return f"{module}.{name}({', '.join(row[0] for row in parameters)}): {description}"
