"""Single changes of a module's functions: the code of each function with one place changed."""

import ast
import copy
from collections.abc import Callable, Iterator
from types import CodeType

OPERATORS: dict[type[ast.AST], type[ast.AST]] = {
    ast.Lt: ast.LtE,
    ast.LtE: ast.Lt,
    ast.Gt: ast.GtE,
    ast.GtE: ast.Gt,
    ast.Eq: ast.NotEq,
    ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot,
    ast.IsNot: ast.Is,
    ast.In: ast.NotIn,
    ast.NotIn: ast.In,
    ast.Add: ast.Sub,
    ast.Sub: ast.Add,
    ast.Mult: ast.Div,
    ast.Div: ast.Mult,
    ast.FloorDiv: ast.Mult,
    ast.Mod: ast.FloorDiv,
    ast.BitAnd: ast.BitOr,
    ast.BitOr: ast.BitAnd,
    ast.And: ast.Or,
    ast.Or: ast.And,
    ast.Break: ast.Continue,
    ast.Continue: ast.Break,
}
NAMES = {
    name: other
    for pair in ("min max", "floor ceil", "any all", "argmin argmax", "minimum maximum")
    for name, other in (pair.split(), pair.split()[::-1])
}
"""Functions that are taken for each other."""

Change = tuple[int, int, str]
"""Number of the node in the tree, which of the changes of that node, and words with the line."""


def changes_of(tree: ast.Module) -> list[Change]:
    """Every possible change."""
    found = []
    inside = _in_functions(tree)
    for number, node in enumerate(ast.walk(tree)):
        if id(node) in inside:
            for which, (words, _) in enumerate(_ways(node)):
                found.append((number, which, f"line {inside[id(node)]}: {words}"))
    return found


def changed_code(tree: ast.Module, change: Change, path: str) -> CodeType:
    """The module's code with that change."""
    changed = copy.deepcopy(tree)
    number, which, _ = change
    node = next(node for at, node in enumerate(ast.walk(changed)) if at == number)
    _ways(node)[which][1]()
    return compile(ast.fix_missing_locations(changed), path, "exec", dont_inherit=True)


def _in_functions(tree: ast.Module) -> dict[int, int]:
    """The lines of the nodes in bodies of functions, less errors, annotations and texts."""
    found: dict[int, int] = {}

    def visit(node: ast.AST, line: int) -> None:
        line = getattr(node, "lineno", line)
        found[id(node)] = line
        if isinstance(node, ast.Raise | ast.JoinedStr | ast.Assert):
            return
        for name, value in ast.iter_fields(node):
            if name in ("annotation", "returns", "args", "decorator_list") and not isinstance(
                node, ast.Call
            ):
                continue
            for child in value if isinstance(value, list) else [value]:
                if isinstance(child, ast.AST):
                    visit(child, line)

    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef):
            for statement in node.body:
                visit(statement, node.lineno)
    return found


def _ways(node: ast.AST) -> list[tuple[str, Callable[[], None]]]:
    """What can be changed about a node itself, in words and in place."""
    return list(_each_way(node))


def _each_way(node: ast.AST) -> Iterator[tuple[str, Callable[[], None]]]:
    if isinstance(node, ast.Compare):
        for at, operator in enumerate(node.ops):
            yield _swapped(operator, node.ops, at)
    elif isinstance(node, ast.BinOp | ast.BoolOp | ast.AugAssign):
        if type(node.op) in OPERATORS:
            other = OPERATORS[type(node.op)]
            words = f"{type(node.op).__name__} -> {other.__name__}"
            yield words, lambda: setattr(node, "op", other())
    elif isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub | ast.Not | ast.Invert):
        yield f"without {type(node.op).__name__}", lambda: setattr(node, "op", ast.UAdd())
    elif isinstance(node, ast.Constant) and isinstance(node.value, int | float):
        value = node.value
        other_value = not value if isinstance(value, bool) else value + 1
        yield f"{value} -> {other_value}", lambda: setattr(node, "value", other_value)
    elif isinstance(node, ast.Attribute) and node.attr in NAMES:
        yield f"{node.attr} -> {NAMES[node.attr]}", lambda: setattr(node, "attr", NAMES[node.attr])
    elif isinstance(node, ast.Name) and node.id in NAMES:
        yield f"{node.id} -> {NAMES[node.id]}", lambda: setattr(node, "id", NAMES[node.id])
    elif isinstance(node, ast.If | ast.While | ast.IfExp):
        turned = ast.UnaryOp(ast.Not(), node.test)
        yield "condition turned round", lambda: setattr(node, "test", turned)
    for name in ("body", "orelse"):
        for at, statement in enumerate(_statements(node, name)):
            if type(statement) in OPERATORS:
                yield _swapped(statement, _statements(node, name), at)
            if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Call):
                words = f"without {ast.unparse(statement)[:40]}"
                yield words, lambda name=name, at=at: _removed(node, name, at)  # type: ignore[misc]


def _statements(node: ast.AST, name: str) -> list[ast.stmt]:
    found = getattr(node, name, [])
    return found if isinstance(found, list) else []


def _removed(node: ast.AST, name: str, at: int) -> None:
    getattr(node, name)[at] = ast.Pass()


def _swapped(old: ast.AST, holder: list, at: int) -> tuple[str, Callable[[], None]]:  # type: ignore[type-arg]
    new = OPERATORS[type(old)]
    return f"{type(old).__name__} -> {new.__name__}", lambda: holder.__setitem__(at, new())
