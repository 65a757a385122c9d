"""Helpers for several kinds of statements: yielding, groups of background jobs, jumps out of them."""

from __future__ import annotations

import ast as py
from collections.abc import Callable

from urbihw.kernel.compiler.emit import STORE, Pos, attr, call, do, except_, if_, is_, name, raise_, set_, try_
from urbihw.kernel.compiler.writer import Writer


def write_yield(w: Writer, p: Pos) -> None:
    """Let other jobs run, if any is ready."""
    w.emit(if_(name("ready", p), [do(call("yield_", [], p), p)], [], p))


def catch_leave(body: list[py.stmt], token: str, handler: list[py.stmt], p: Pos) -> list[py.stmt]:
    """Statements that end with a ``Leave`` with the token in this variable; a ``Leave`` with another token is
    re-raised.
    """
    foreign = is_(attr(name("_l", p), "token", p), name(token, p), p, negated=True)
    handler = [if_(foreign, [raise_(None, p)], [], p), *handler]
    return [set_(token, call("token", [], p), p), try_(body, [except_("Leave", "_l", handler, p)], [], [], p)]


def write_group(w: Writer, write: Callable[[str], None], p: Pos) -> None:
    """A block that waits for its background jobs: ``with group() as g: ...``."""
    text = w.fresh("_g")
    w.body.groups.append(text)
    body = w.block(lambda: write(text))
    w.body.groups.pop()
    item = py.withitem(call("group", [], p), py.Name(text, STORE, **p))
    w.emit(py.With([item], body or [py.Pass(**p)], None, **p))


def write_abandon(w: Writer, kept: int, p: Pos) -> None:
    """Stop the background jobs of the blocks that are being left: all but the outermost ``kept`` ones."""
    for group in reversed(w.body.groups[kept:]):
        w.emit(do(call(attr(name(group, p), "abandon", p), [], p), p))


def write_closing_scope(w: Writer, write: Callable[[], None], p: Pos) -> None:
    """The statements of a scope; its scope tag is stopped before the background jobs are waited for."""
    close, w.body.close_scope = w.body.close_scope, None
    if close is None:
        write()
    else:
        w.emit(try_(w.block(write), [], [], [close()], p))
