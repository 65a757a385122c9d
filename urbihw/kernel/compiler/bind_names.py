"""Binding: names and messages, declarations and assignments, functions and objects."""

from __future__ import annotations

from typing import Final

from urbihw.kernel.compiler.operations import LOGICAL, operator_of
from urbihw.kernel.compiler.scopes import NameScope, binding_names, is_binding, left_of, spine
from urbihw.kernel.compiler.walk import SCOPE_TAG, Binder
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.binding import FunctionFrame, Local

DETACHERS: Final = ("detach", "spawn")
"""Functions that start detached jobs, which keep the tags of their maker."""


# ---------------------------------------------------------------- names and slots


def bind_this(node: ast.This | ast.Property, b: Binder) -> None:
    """``this``."""
    b.use_this(node)


def bind_call_message(node: ast.CallKeyword, b: Binder) -> None:
    """``call``: that of the innermost function."""
    frame = b.function_around()
    if frame is not None:
        frame.uses_call = True
    b.bound(node).local = b.lookup("call")


def bind_operation(node: ast.Call | ast.And | ast.Or, b: Binder) -> None:
    """A message or an operation; the left side may be deep and is not walked recursively (``spine``)."""
    if node.__class__ is ast.Call and node.target is None:
        bind_message(node, b)
        return
    nodes = spine(node, b.pace)
    while len(nodes) > 1 and is_scope_tag(nodes[-2]):
        nodes.pop()
    if not is_scope_tag(nodes[-1]):
        b.walk(left_of(nodes[-1]))
    for each in reversed(nodes):
        if isinstance(each, ast.Call):
            bind_message(each, b)
        else:
            assert isinstance(each, ast.And | ast.Or)
            if operator_of(each) in b.result.lazy_names:
                b.bound(each).lazy = True
                b.use_this(each)
                b.framed(each.right)
            else:
                b.walk(each.right)


def bind_message(node: ast.Call, b: Binder) -> None:
    """A call, but for its target."""
    if node.name in DETACHERS:
        for body in b.bodies:
            b.bound(body).detaches = True
    if is_scope_tag(node):
        bind_scope_tag(node, b)
        return
    if node.target is None:
        b.bound(node).local = b.lookup(node.name)
    b.use_this(node)
    if node.name in b.result.lazy_names:
        b.bound(node).lazy = True
        for argument in node.args or ():
            b.framed(argument)
    elif node.args:
        b.walk_all(node.args)


def is_scope_tag(node: ast.Node) -> bool:
    """Whether a node is ``scopeTag``, ``Tag.scope`` or ``System.scopeTag``."""
    if not isinstance(node, ast.Call) or node.name not in ("scopeTag", "scope") or node.args:
        return False
    target = node.target
    if target is None:
        return node.name == "scopeTag"
    if not isinstance(target, ast.Call) or target.target is not None:
        return False
    return (target.name, node.name) in (("Tag", "scope"), ("System", "scopeTag"))


def bind_scope_tag(node: ast.Call, b: Binder) -> None:
    """The tag of the innermost block of this frame, which has one from now on."""
    scope = b.scope
    while not scope.block and scope.outer is not None and scope.outer.frame is b.frame:
        scope = scope.outer
    local = scope.names.get(SCOPE_TAG)
    if local is None:
        local = scope.names[SCOPE_TAG] = Local("scopeTag", b.frame.unique("scopeTag"), b.frame, False)
    b.bound(node).local = local


def bind_property(node: ast.Property, b: Binder) -> None:
    """``slot->name``."""
    b.use_this(node)
    b.walk(node.slot.target)


def bind_var(node: ast.Var, b: Binder) -> None:
    """``var name``: a local, or a slot."""
    note_function(node.name, node.value, b)
    if node.target is not None:
        b.walk(node.target)
        b.walk(node.value)
        return
    b.walk(node.value)
    if b.scope.slots:
        b.use_this(node)
        return
    local = b.declare(node.name)
    local.const = node.const
    local.maybe_void = node.value is None
    if node.value is None:
        local.assigned = True
    b.bound(node).local = local


def note_function(name: str, value: ast.Node | None, b: Binder) -> None:
    """Record a name that gets a lazy function, or an operator that gets any function: from now on it is sent
    unevaluated arguments.
    """
    if isinstance(value, ast.Function) and (value.formals is None or name in LOGICAL):
        b.result.lazy_names.add(name)


def bind_assign(node: ast.Assign, b: Binder) -> None:
    """``place = value``; what a pattern binds is declared here."""
    if isinstance(node.place, ast.Call):
        note_function(node.place.name, node.value, b)
    b.walk(node.value)
    for _, modifier in node.modifiers:
        b.walk(modifier)
    if isinstance(node.place, ast.Call) and node.place.args is None:
        bind_place(node.place, b, bool(node.modifiers))
    elif isinstance(node.place, ast.Property):
        b.walk(node.place)
    else:
        bind_pattern(node.place, b)


def bind_place(place: ast.Call, b: Binder, moved: bool = False) -> None:
    """A variable, slot or element that is written; ``moved``: by a trajectory."""
    if place.name == "[]" or place.args:
        b.walk(place)
        return
    if place.target is None:
        local = b.lookup(place.name)
        if local is not None:
            local.assigned = True
            if moved:
                local.captured = True
            b.bound(place).local = local
    else:
        b.walk(place.target)
    b.use_this(place)


def bind_op_assign(node: ast.OpAssign, b: Binder) -> None:
    """``place += value``; the place is read first, before what the value declares."""
    bind_target(node.place, b)
    b.walk(node.value)


def bind_postfix(node: ast.Postfix, b: Binder) -> None:
    """``place++``."""
    bind_target(node.place, b)


def bind_target(place: ast.Node, b: Binder) -> None:
    """The target of ``+=``, ``++`` and the like."""
    if isinstance(place, ast.Call):
        bind_place(place, b)
    else:
        b.walk(place)


def bind_pattern(node: ast.Node, b: Binder) -> None:
    """A pattern in this frame: values in it are evaluated, its bindings are declared here."""
    bind_values(node, b)
    b.declare_all(binding_names((node,)), node)


def bind_values(node: ast.Node, b: Binder) -> None:
    """The values in a pattern."""
    if is_binding(node):
        return
    if isinstance(node, ast.ListLit | ast.TupleLit):
        for item in node.items:
            bind_values(item, b)
    elif isinstance(node, ast.DictLit):
        for key, item in node.pairs:
            b.walk(key)
            bind_values(item, b)
    else:
        b.walk(node)


# ---------------------------------------------------------------- functions and objects


def bind_function(node: ast.Function, b: Binder) -> None:
    """A function literal: a frame with ``call``, the arguments, and ``this`` if it is no closure."""
    frame = FunctionFrame(b.frame, literal=True)
    b.bound(node).function = frame
    outer = (b.frame, b.scope, b.this, b.blocks)
    b.frame, b.scope, b.blocks = frame, NameScope(b.scope, frame, slots=False), 0
    b.scope.names["call"] = frame.call = Local("call", frame.unique("call"), frame, False)
    if node.closure:
        b.use_this(node)
    else:
        b.this = frame.this = b.declare("this")
    for formal in node.formals or ():
        b.walk(formal.default)
        local = b.declare(formal.name)
        local.assigned = formal.default is not None
        frame.params.append(local)
    b.walk(node.body)
    b.frame, b.scope, b.this, b.blocks = outer


def bind_do(node: ast.Do, b: Binder) -> None:
    """``do (target) body``."""
    b.walk(node.target)
    bind_body(node.body, b)


def bind_class(node: ast.Class, b: Binder) -> None:
    """``class name : protos body``."""
    b.walk(node.target)
    b.walk_all(node.protos)
    if node.target is None and not b.scope.slots:
        b.bound(node).local = b.declare(node.name)
    elif node.target is None:
        b.use_this(node)
    bind_body(node.body, b)


def bind_body(body: ast.Scope, b: Binder) -> None:
    """A body whose ``this`` is an object of its own, and whose variables are slots of that."""
    outer_scope, outer_this = b.scope, b.this
    b.scope = NameScope(b.scope, b.frame, slots=True)
    b.this = b.bound(body).this = b.declare("this")
    b.walk(body.body)
    b.scope, b.this = outer_scope, outer_this
