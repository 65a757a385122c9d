"""Which names are local variables, where they live, and who captures them.

A *frame* will be one Python function: the statement itself, each function literal, and each piece of code that runs
as a job of its own or later (the parts of ``&``, what stands before ``,``, conditions and bodies of ``at``, lazy
arguments).  A frame contains nested *scopes*; a scope maps names to ``Local``s.  The scopes of a top-level
statement and of a ``do`` or ``class`` body make slots instead of locals.  ``this`` and ``call`` are locals too, under
those names.

A local that an inner frame reads is *captured*; one that is captured and assigned again is kept in a ``Box``, so
that all frames (and watched conditions) see the change.  A local declared inside a loop is a fresh one in each turn:
an inner function that captures it is made by a factory taking it as a parameter.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from urbihw.kernel.compiler.scopes import Binding, Frame, Local, Scope, binding_names, is_binding, left_of, spine
from urbihw.kernel.compiler.walk import Walker
from urbihw.kernel.syntax import ast
from urbihw.kernel.syntax.pace import Pace

DETACHERS: Final = ("detach", "spawn")
"""Calls that make jobs which go on by themselves, under the tags of their maker."""


class Binder(Walker):
    """One walk over the statement; a method ``_Node`` per node with scoping rules of its own."""

    # ---------------------------------------------------------------- names and slots

    def _This(self, node: ast.This) -> None:
        self.use_this(node)

    def _CallMessage(self, node: ast.CallMessage) -> None:
        frame: Frame | None = self.frame
        while frame is not None and frame.function is None:
            frame = frame.parent
        if frame is not None:
            frame.uses_call = True
        local = self.lookup("call")
        if local is not None:
            self.result.locals[id(node)] = local

    def _Call(self, node: ast.Node) -> None:
        """A message or an operation; ``spine`` says why this does not simply walk the left side."""
        nodes = spine(node, self.pace)
        while len(nodes) > 1 and _is_scope_tag(nodes[-2]):
            nodes.pop()
        if not _is_scope_tag(nodes[-1]):
            self.walk(left_of(nodes[-1]))
        for each in reversed(nodes):
            if isinstance(each, ast.Call):
                self._message(each)
            else:
                assert isinstance(each, ast.And | ast.Or)
                self.walk(each.right)

    _And = _Or = _Call

    def _message(self, node: ast.Call) -> None:
        """A call, but for its target."""
        if node.name in DETACHERS:
            self.result.detaching.update(self.bodies)
        if _is_scope_tag(node):
            self._scope_tag(node)
            return
        if node.target is None:
            local = self.lookup(node.name)
            if local is not None:
                self.result.locals[id(node)] = local
        self.use_this(node)
        if node.args and node.name in self.result.lazy_names:
            for argument in node.args:
                self.framed(argument)
        else:
            self.walk(node.args)

    def _scope_tag(self, node: ast.Call) -> None:
        scope = self.scope
        while not scope.block and scope.outer is not None and scope.outer.frame is self.frame:
            scope = scope.outer
        local = scope.names.get(" scope tag")
        if local is None:
            local = scope.names[" scope tag"] = Local("scopeTag", self.frame.unique("scopeTag"), self.frame, False)
        self.result.locals[id(node)] = local

    def _Property(self, node: ast.Property) -> None:
        self.use_this(node)
        self.walk(node.slot.target)

    def _Var(self, node: ast.Var) -> None:
        if isinstance(node.value, ast.Function) and node.value.formals is None:
            self.result.lazy_names.add(node.name)
        if node.target is not None:
            self.walk(node.target)
            self.walk(node.value)
            return
        self.walk(node.value)
        if self.scope.slots:
            self.use_this(node)
            return
        local = self.declare(node.name)
        local.const = node.const
        local.maybe_void = node.value is None
        if node.value is None:
            local.assigned = True
        self.result.locals[id(node)] = local

    def _Assign(self, node: ast.Assign) -> None:
        if isinstance(node.value, ast.Function) and node.value.formals is None and isinstance(node.place, ast.Call):
            self.result.lazy_names.add(node.place.name)
        self.walk(node.value)
        for _, modifier in node.modifiers:
            self.walk(modifier)
        if isinstance(node.place, ast.Call):
            self._place(node.place, bool(node.modifiers))
        elif isinstance(node.place, ast.Property):
            self.walk(node.place)
        else:
            self.pattern(node.place)

    def _place(self, place: ast.Call, moved: bool = False) -> None:
        if place.name == "[]" or place.args:
            self.walk(place)
            return
        if place.target is None:
            local = self.lookup(place.name)
            if local is not None:
                local.assigned = True
                if moved:
                    local.captured = True
                self.result.locals[id(place)] = local
        else:
            self.walk(place.target)
        self.use_this(place)

    def _OpAssign(self, node: ast.OpAssign) -> None:
        self.walk(node.value)
        self._target(node.place)

    def _Postfix(self, node: ast.Postfix) -> None:
        self._target(node.place)

    def _target(self, place: ast.Node) -> None:
        if isinstance(place, ast.Call):
            self._place(place)
        else:
            self.walk(place)

    def pattern(self, node: ast.Node) -> None:
        """A pattern in this frame: values in it are evaluated, its bindings are declared here."""
        self._pattern_values(node)
        made: list[Local | None] = []
        for name in binding_names((node,)):
            if self.scope.slots:
                self.use(self.this)
                self.result.this[id(node)] = self.this
                made.append(None)
            else:
                made.append(self.declare(name))
        self.result.patterns[id(node)] = made

    def _pattern_values(self, node: ast.Node) -> None:
        if is_binding(node):
            return
        if isinstance(node, ast.ListLit | ast.TupleLit):
            for item in node.items:
                self._pattern_values(item)
        elif isinstance(node, ast.DictLit):
            for key, item in node.pairs:
                self.walk(key)
                self._pattern_values(item)
        else:
            self.walk(node)

    # ---------------------------------------------------------------- functions and objects

    def _Function(self, node: ast.Function) -> None:
        frame = Frame(self.frame, node)
        self.result.frames[id(node)] = frame
        outer = (self.frame, self.scope, self.this, self.blocks)
        self.frame, self.scope, self.blocks = frame, Scope(self.scope, frame, slots=False), 0
        self.scope.names["call"] = self.result.own_call[id(node)] = Local("call", frame.unique("call"), frame, False)
        try:
            if node.closure:
                self.use_this(node)
            else:
                self.this = self.result.own_this[id(node)] = self.declare("this")
            formals = []
            for formal in node.formals or ():
                self.walk(formal.default)
                local = self.declare(formal.name)
                local.assigned = formal.default is not None
                formals.append(local)
            self.result.formals[id(node)] = formals
            self.walk(node.body)
        finally:
            self.frame, self.scope, self.this, self.blocks = outer

    def _Do(self, node: ast.Do) -> None:
        self.walk(node.target)
        self._body_of(node, node.body)

    def _Class(self, node: ast.Class) -> None:
        self.walk(node.target)
        self.walk(node.protos)
        if node.target is None and not self.scope.slots:
            self.result.locals[id(node)] = self.declare(node.name)
        elif node.target is None:
            self.use_this(node)
        self._body_of(node, node.body)

    def _body_of(self, node: ast.Node, body: ast.Scope) -> None:
        outer_scope, outer_this = self.scope, self.this
        self.scope = Scope(self.scope, self.frame, slots=True)
        self.this = self.declare("this")
        self.result.this[id(body)] = self.this
        try:
            self.walk(body.body)
        finally:
            self.scope, self.this = outer_scope, outer_this

    # ---------------------------------------------------------------- composition and flow

    def _Scope(self, node: ast.Scope) -> None:
        outer = self.scope
        self.scope = Scope(outer, self.frame, slots=False, block=True)
        self.walk(node.body)
        self.keep_scope_tag(node)
        self.scope = outer

    def _Seq(self, node: ast.Seq) -> None:
        for item, separator in node.items:
            if separator == ",":
                self._background(item)
            else:
                self.walk(item)

    def _background(self, item: ast.Node) -> None:
        if isinstance(item, ast.Var) and item.target is None and not self.scope.slots:
            local = self.declare(item.name)
            local.captured = local.assigned = local.maybe_void = True
            self.result.locals[id(item)] = local
            if item.value is not None:
                self.framed(item.value).free[local] = None
        else:
            self.framed(item)

    def _Par(self, node: ast.Par) -> None:
        for item in node.items:
            self._background(item)

    def _If(self, node: ast.If) -> None:
        self.scope = Scope(self.scope, self.frame, slots=False)
        self.walk(node.cond)
        self.scoped(node.then)
        self.scoped(node.otherwise)
        assert self.scope.outer is not None
        self.scope = self.scope.outer

    def _While(self, node: ast.While) -> None:
        self.loop(node.cond, node.body, node.flavor == ",")

    def _For(self, node: ast.For) -> None:
        self.scope = Scope(self.scope, self.frame, slots=False)
        self.walk(node.init)
        self.frame.loops += 1
        self.bodies.append(id(node.body))
        self.walk(node.cond)
        if node.flavor == ",":
            self.framed(node.body)
        else:
            self.scoped(node.body)
        self.bodies.pop()
        self.walk(node.step)
        self.frame.loops -= 1
        assert self.scope.outer is not None
        self.scope = self.scope.outer

    def _ForEach(self, node: ast.ForEach) -> None:
        self.walk(node.items)
        self.frame.loops += 1
        self.scope = Scope(self.scope, self.frame, slots=False)
        if node.name is not None:
            self.result.locals[id(node)] = self.declare(node.name)
        self.bodies.append(id(node.body))
        if node.flavor == "&":
            self.framed(node.body)
        else:
            self.walk(node.body)
        self.bodies.pop()
        assert self.scope.outer is not None
        self.scope = self.scope.outer
        self.frame.loops -= 1

    def _Switch(self, node: ast.Switch) -> None:
        self.walk(node.value)
        for case in node.cases:
            self.scope = Scope(self.scope, self.frame, slots=False)
            if case.pattern is not None:
                self.pattern(case.pattern)
            self.walk(case.guard)
            self.walk(case.body)
            assert self.scope.outer is not None
            self.scope = self.scope.outer

    def _Try(self, node: ast.Try) -> None:
        self.walk(node.body)
        for catch in node.catches:
            self.scope = Scope(self.scope, self.frame, slots=False)
            if catch.pattern is not None:
                self.pattern(catch.pattern)
            self.walk(catch.guard)
            self.walk(catch.body)
            assert self.scope.outer is not None
            self.scope = self.scope.outer
        self.walk(node.otherwise)
        if self.apart and node.final is not None:
            self.result.apart.add(id(node.final))
            self.framed(node.final)
        else:
            self.walk(node.final)

    def _Return(self, node: ast.Return) -> None:
        self.walk(node.value)
        frame: Frame | None = self.frame
        while frame is not None and frame.function is None:
            frame = frame.parent
        if frame is not None and frame is not self.frame:
            frame.returns_through = True

    def _Assert(self, node: ast.Assert) -> None:
        for claim in node.claims:
            if isinstance(claim, ast.Call):
                self.use_this(claim)
                if claim.target is None:
                    local = self.lookup(claim.name)
                    if local is not None:
                        self.result.locals[id(claim)] = local
                else:
                    self.walk(claim.target)
                for argument in claim.args or ():
                    self.framed(argument)
            else:
                self.walk(claim)

    # ---------------------------------------------------------------- time, events, tags

    def _Tagged(self, node: ast.Tagged) -> None:
        self.use_this(node)
        self.walk(node.tag)
        self.walk(node.body)

    def _At(self, node: ast.At) -> None:
        bound = self._condition(node.cond)
        self.framed(node.body, bound)
        if node.leave is not None:
            self.framed(node.leave, bound)

    def _Whenever(self, node: ast.Whenever) -> None:
        bound = self._condition(node.cond)
        self.framed(node.body, bound)
        if node.otherwise is not None:
            self.framed(node.otherwise)

    def _WaitUntil(self, node: ast.WaitUntil) -> None:
        bound = self._condition(node.cond)
        made: list[Local | None] = []
        for name in binding_names(bound):
            if self.scope.slots:
                self.use_this(node)
                made.append(None)
            else:
                made.append(self.declare(name))
        self.result.patterns[id(node)] = made

    def _condition(self, cond: ast.EventCond | ast.ExprCond) -> tuple[ast.Node, ...]:
        self.walk(cond.duration)
        if isinstance(cond, ast.ExprCond):
            self.framed(cond.expr)
            return ()
        self.walk(cond.event)
        bound = cond.patterns or ()
        frame = Frame(self.frame, None)
        self.result.frames[id(cond)] = frame
        outer = (self.frame, self.scope)
        self.frame, self.scope = frame, Scope(self.scope, frame, slots=False)
        for pattern in bound:
            self._pattern_values(pattern)
        self.result.formals[id(cond)] = [self.declare(name) for name in binding_names(bound)]
        self.walk(cond.guard)
        self.frame, self.scope = outer
        return bound

    def _Every(self, node: ast.Every) -> None:
        self.loop(node.period, node.body, node.flavor == ",")

    def _Guarded(self, node: ast.Guarded) -> None:
        cond = node.cond.expr if isinstance(node.cond, ast.ExprCond) else node.cond
        if node.kind == "timeout":
            self.walk(cond)
        elif isinstance(node.cond, ast.EventCond):
            self._condition(node.cond)
        else:
            self.framed(cond)
        self.walk(node.body)

    def __call__(self, node: ast.Node) -> Binding:
        """Bind one statement."""
        self.walk(node)
        self.keep_scope_tag(node)
        return self.result


def _is_scope_tag(node: ast.Node) -> bool:
    if not isinstance(node, ast.Call):
        return False
    if node.args:
        return False
    if node.target is None:
        return node.name == "scopeTag"
    if not isinstance(node.target, ast.Call) or node.target.target is not None:
        return False
    return (node.target.name, node.name) in (("Tag", "scope"), ("System", "scopeTag"))


def bind(
    node: ast.Node, lazy_names: Iterable[str], late: Iterable[str] = (), apart: bool = False, pace: Pace | None = None
) -> Binding:
    """Find the local variables of one top-level statement; ``late`` are names of variables of a waiting frame.

    ``apart``: what is deep inside other loops, tags and ``try``s becomes a function of its own.  Raises TooDeep, and
    TooLong for what captures too much.
    """
    binder = Binder(lazy_names, apart, pace or Pace())
    for name in late:
        local = binder.declare(name)
        local.late = local.maybe_void = True
    binder.scope = Scope(binder.scope, binder.frame, slots=True, block=True)
    return binder(node)
