"""Every fault that the rules know of a Python file, found on its syntax tree.

Left alone is what cannot change behavior or is none of it: docstrings, annotations, imports and
decorators; what an error, a warning, a log line, a progress line or the help of a command says; in
files that draw, constants, and the calls and keywords that only place, color, size or name; the
encoding of a file and the strictness of `zip`. A fault whose bytecode is that of the original file
is none, nor are swapped arguments whose order is nothing to their function. A limit moved onto its
bound (< to <=) is one only beside a number or a length: two computed numbers are never equal.
"""

import ast
import re
from collections.abc import Iterator
from types import CodeType

from benchmarks.mutation.faults import Fault

OPPOSITE = {
    ast.Lt: ">=",
    ast.LtE: ">",
    ast.Gt: "<=",
    ast.GtE: "<",
    ast.Eq: "!=",
    ast.NotEq: "==",
    ast.Is: "is not",
    ast.IsNot: "is",
    ast.In: "not in",
    ast.NotIn: "in",
}
ON_BOUND = {ast.Lt: "<=", ast.LtE: "<", ast.Gt: ">=", ast.GtE: ">"}
ARITHMETIC = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*", ast.Pow: "*", ast.Mod: "//"}
EXCHANGED = {
    "min": "max",
    "fmin": "fmax",
    "minimum": "maximum",
    "argmin": "argmax",
    "nanmin": "nanmax",
    "smaller": "larger",
    "sin": "cos",
    "sinh": "cosh",
    "any": "all",
    "logic_and": "logic_or",
    "floor": "ceil",
    "vstack": "hstack",
    "vertcat": "horzcat",
    "radians": "degrees",
    "deg2rad": "rad2deg",
    "zeros": "ones",
    "mean": "median",
}
EXCHANGED |= {new: old for old, new in EXCHANGED.items()}
SYMMETRIC = {"minimum", "maximum", "fmin", "fmax", "hypot"}  # of their first two arguments
DROPPED_CALLS = {"abs", "fabs", "sqrt", "reversed", "sorted", "round", "flip", "cumsum", "conj"}
OPERATOR = r"\*\*|//|[-+*/%]|[<>=!]=|[<>]|\bis not\b|\bis\b|\bnot in\b|\bin\b|\band\b|\bor\b"
AXLES = re.compile(r"(?<![a-z])(front|rear)(?![a-z])|(?<=_)([fr])(?![a-zA-Z0-9])")
OTHER_AXLE = {"front": "rear", "rear": "front", "f": "r", "r": "f"}

# Offsets inside f-strings are not those of the file before Python 3.12.
LEFT_ALONE = (ast.Import, ast.ImportFrom, ast.Delete, ast.JoinedStr)
SPOKEN = {
    "warn", "warning", "info", "debug", "error", "exception", "say", "print", "add_parser",
    "add_argument_group", "ArgumentParser",
}  # fmt: skip
HELP = {"help", "description", "metavar", "epilog", "title", "usage"}
SAME = {"encoding", "strict"}  # UTF-8 is the default here; zip(strict=) guards, it does not compute
DRAWINGS = ("tireid/figures/",)
PLACED = {
    "set_ylim", "set_xlim", "tick_params", "legend", "margins", "subplots_adjust", "annotate",
    "align_ylabels", "set_title", "set_xlabel", "set_ylabel", "set_label", "set_visible",
    "set_position", "set_yticks", "set_xticks", "set_yticklabels", "set_xticklabels", "text",
    "axhline", "axvline", "set_animated", "set_alpha", "set_linewidth", "new_figure", "grid",
    "locator_params", "set_aspect", "legend_above", "add_artist", "rc_context",
}  # fmt: skip
LOOKS = {
    "color", "colors", "linewidth", "linewidths", "linestyle", "alpha", "zorder", "fontsize",
    "size", "marker", "markersize", "markerfacecolor", "markeredgewidth", "ha", "va", "loc",
    "facecolor", "edgecolor", "pad", "labelpad", "rotation", "dpi", "figsize", "label", "lw",
    "xlabel", "ylabel", "xlim", "ylim", "aspect", "transform", "clip_on", "height_ratios",
    "width_ratios", "hspace", "wspace", "fontweight",
}  # fmt: skip


def python_faults(file: str, source: bytes) -> list[Fault]:
    """Return every fault of a file, in the order of its text.

    Parameters
    ----------
    file : path that the faults name.
    source : its content.
    """
    rules = _Rules(file, source)
    rules.visit(ast.parse(source))
    return sorted(set(rules.faults), key=lambda fault: (fault.start, fault.end, fault.new))


def changes_bytecode(source: bytes, planted: bytes) -> bool:
    """Return whether a fault compiles, and to something else than the original file.

    Parameters
    ----------
    source : the original file.
    planted : the file with the fault.
    """
    try:
        return _skeleton(compile(source, "", "exec")) != _skeleton(compile(planted, "", "exec"))
    except (SyntaxError, ValueError):
        return False


def _skeleton(code: CodeType) -> tuple[object, ...]:
    """Return what runs, without the places of lines."""
    constants = tuple(
        _skeleton(c) if isinstance(c, CodeType) else (type(c).__name__, repr(c))
        for c in code.co_consts
    )
    return (code.co_code, constants, code.co_names, code.co_varnames, code.co_exceptiontable)


class _Rules(ast.NodeVisitor):
    """Walk the tree, leave out what the rules leave out, collect faults."""

    def __init__(self, file: str, source: bytes) -> None:
        self.file, self.source, self.faults = file, source, list[Fault]()
        self.starts = [0]
        for line in source.split(b"\n"):
            self.starts.append(self.starts[-1] + len(line) + 1)
        drawn = b"import matplotlib" in source or b"from matplotlib" in source
        self.draws = drawn or file.startswith(DRAWINGS)
        self.names = set(re.findall(r"\w+", source.decode()))

    def visit(self, node: ast.AST) -> None:
        """Visit a node and what is in it, unless it is left alone."""
        if not isinstance(node, LEFT_ALONE):
            super().visit(node)

    def visit_Raise(self, node: ast.Raise) -> None:
        """Forget a check; what it would say is left alone."""
        self._replace("forgotten check", node, "pass")

    def visit_FunctionDef(self, node: ast.FunctionDef) -> None:
        """Visit defaults and body, not annotations and decorators."""
        defaults = [*node.args.defaults, *node.args.kw_defaults]
        self._visit_all([default for default in defaults if default is not None])
        self._body(node.body)

    def visit_ClassDef(self, node: ast.ClassDef) -> None:
        """Visit the body, not bases and decorators."""
        self._body(node.body)

    def visit_Module(self, node: ast.Module) -> None:
        """Visit everything but the docstring."""
        self._body(node.body)

    def visit_Lambda(self, node: ast.Lambda) -> None:
        """Visit the body alone."""
        self.visit(node.body)

    def visit_AnnAssign(self, node: ast.AnnAssign) -> None:
        """Visit the value, not the type."""
        if node.value is not None and not _type_alias(node.annotation):
            self._value(node.value)
            self.visit(node.value)

    def _body(self, body: list[ast.stmt]) -> None:
        for statement in body:
            if _is_text(statement) or _for_types(statement):
                continue
            self.visit(statement)

    def visit_Assign(self, node: ast.Assign) -> None:
        """Turn the sign of a computed value."""
        if any(isinstance(t, ast.Name) and t.id.startswith("__") for t in node.targets):
            return
        if isinstance(node.value, ast.Call | ast.Subscript) and _type_expression(node.value):
            return
        self._value(node.value)
        self._visit_all([*[t for t in node.targets if isinstance(t, ast.Subscript)], node.value])

    def visit_AugAssign(self, node: ast.AugAssign) -> None:
        """Forget it, or turn its operator."""
        self._replace("forgotten statement", node, "pass")
        new = ARITHMETIC.get(type(node.op))
        if new and not _words(node.value):
            gap = self._span(node.target)[1], self._span(node.value)[0]
            self._add("arithmetic", *gap, f" {new}= ")
        self.visit(node.value)

    def visit_Expr(self, node: ast.Expr) -> None:
        """Forget a call whose answer is not used."""
        if isinstance(node.value, ast.Call) and not self._unheard(node.value):
            self._replace("forgotten statement", node, "pass")
        self.visit(node.value)

    def visit_Return(self, node: ast.Return) -> None:
        """Turn the sign of a computed answer."""
        if node.value is not None:
            self._value(node.value)
            self.visit(node.value)

    def visit_If(self, node: ast.If) -> None:
        """Take one branch always; `if` on a raise is left to the forgotten check."""
        if not isinstance(node.body[0], ast.Raise):
            self._replace("condition fixed", node.test, "True")
            self._replace("condition fixed", node.test, "False")
        self.generic_visit(node)

    def visit_IfExp(self, node: ast.IfExp) -> None:
        """Take one side always."""
        for side in (node.body, node.orelse):
            self._replace("condition fixed", node, f"({self._text(side)})")
        self.generic_visit(node)

    def visit_Break(self, node: ast.Break) -> None:
        """Go on with the loop."""
        self._replace("loop", node, "continue")

    def visit_Continue(self, node: ast.Continue) -> None:
        """End the loop."""
        self._replace("loop", node, "break")

    def visit_Compare(self, node: ast.Compare) -> None:
        """Turn a comparison, or move it onto its bound."""
        left = node.left
        for operator, right in zip(node.ops, node.comparators, strict=True):
            gap = self._span(left)[1], self._span(right)[0]
            self._add("comparison", *gap, self._between(*gap, OPPOSITE[type(operator)]))
            if type(operator) in ON_BOUND and (_counted(left) or _counted(right)):
                self._add("comparison", *gap, self._between(*gap, ON_BOUND[type(operator)]))
            left = right
        self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> None:
        """Exchange `and` and `or`, or drop a part."""
        word, other = ("and", "or") if isinstance(node.op, ast.And) else ("or", "and")
        for one, two in zip(node.values, node.values[1:], strict=False):
            gap = self._span(one)[1], self._span(two)[0]
            self._add("logic", *gap, self._between(*gap, other))
        for dropped in node.values:
            kept = [self._text(value) for value in node.values if value is not dropped]
            self._replace("dropped condition", node, f"({f' {word} '.join(kept)})")
        self.generic_visit(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> None:
        """Drop `not` and minus."""
        if isinstance(node.op, ast.Not):
            self._replace("logic", node, self._text(node.operand))
        elif isinstance(node.op, ast.USub) and not self.draws:
            self._replace("sign", node, self._text(node.operand))
        self.generic_visit(node)

    def visit_BinOp(self, node: ast.BinOp) -> None:
        """Exchange the operator, drop a term or a factor."""
        if not _words(node) and not (self.draws and _plain(node)):
            start, end = self._span(node.left)[1], self._span(node.right)[0]
            new = ARITHMETIC.get(type(node.op))
            if new:
                self._add("arithmetic", start, end, self._between(start, end, new))
            kind = "dropped term" if isinstance(node.op, ast.Add | ast.Sub) else "dropped factor"
            if not isinstance(node.op, ast.BitOr | ast.BitAnd | ast.MatMult):
                self._replace(kind, node, self._text(node.left))
            if isinstance(node.op, ast.Add | ast.Mult):
                self._replace(kind, node, self._text(node.right))
        self.generic_visit(node)

    def visit_Constant(self, node: ast.Constant) -> None:
        """Change a number, turn a truth."""
        if self.draws or isinstance(node.value, str | bytes | type(None)):
            return
        if isinstance(node.value, bool):
            self._replace("truth", node, str(not node.value))
        elif isinstance(node.value, int):
            self._replace("number", node, str(node.value + 1))
            if node.value > 1:
                self._replace("number", node, str(node.value - 1))
        elif isinstance(node.value, float):
            self._replace("number", node, repr(node.value * 1.5) if node.value else "1.0")
            if node.value:
                self._replace("sign", node, f"-{self._text(node)}")

    def visit_Subscript(self, node: ast.Subscript) -> None:
        """Take the other of two entries, move a slice by one."""
        parts = node.slice.elts if isinstance(node.slice, ast.Tuple) else [node.slice]
        for part in parts:
            if isinstance(part, ast.Constant) and part.value in (0, 1) and type(part.value) is int:
                self._replace("index", part, str(1 - part.value))
            elif isinstance(part, ast.Slice):
                for bound in (part.lower, part.upper):
                    if bound is not None:
                        self._replace("slice", bound, f"{self._text(bound)} + 1")
                        if not (isinstance(bound, ast.Constant) and bound.value == 0):
                            self._replace("slice", bound, f"{self._text(bound)} - 1")
            else:
                self.visit(part)
        self.visit(node.value)

    def visit_Name(self, node: ast.Name) -> None:
        """Take the other axle's, where there is one of that name."""
        self._other_axle(node, node.id)

    def visit_Attribute(self, node: ast.Attribute) -> None:
        """Take the other axle's, where there is one of that name."""
        end = self._span(node)[1]
        start = end - len(node.attr.encode())
        for new in self._other_names(node.attr):
            self._add("front and rear", start, end, new)
        self.visit(node.value)

    def visit_Call(self, node: ast.Call) -> None:
        """Call something near, forget the call, swap arguments, forget a keyword."""
        if self._unheard(node):
            return
        name = _called(node)
        if name in EXCHANGED:
            end = self._span(node.func)[1]
            self._add("near function", end - len(name), end, EXCHANGED[name])
        if name in DROPPED_CALLS and len(node.args) == 1:
            self._replace("dropped call", node, f"({self._text(node.args[0])})")
        for one, two in zip(node.args, node.args[1:], strict=False):
            starred = isinstance(one, ast.Starred) or isinstance(two, ast.Starred)
            if not (starred or _symmetric(node)):
                first, second = self._span(one), self._span(two)
                middle = self.source[first[1] : second[0]].decode()
                swapped = f"{self._text(two)}{middle}{self._text(one)}"
                self._add("swapped arguments", first[0], second[1], swapped)
        for keyword in node.keywords:
            self._keyword(node, keyword)
        self._visit_all([node.func, *node.args])

    def _keyword(self, call: ast.Call, keyword: ast.keyword) -> None:
        if keyword.arg in HELP | SAME or (self.draws and keyword.arg in LOOKS):
            return
        start, end = self._span(keyword)
        after = re.match(rb"\s*,\s*", self.source[end:])
        if keyword.arg and (after or len(call.keywords) + len(call.args) == 1):
            stop = end + (after.end() if after else 0)
            self._add("forgotten keyword", start, stop, "")
        self.visit(keyword.value)

    def _value(self, value: ast.expr) -> None:
        """Turn the sign of what is computed, not of words, calls and collections."""
        if isinstance(value, ast.BinOp) and not _words(value) and not self.draws:
            self._replace("sign", value, f"-({self._text(value)})")

    def _other_axle(self, node: ast.expr, name: str) -> None:
        for new in self._other_names(name):
            self._replace("front and rear", node, new)

    def _other_names(self, name: str) -> Iterator[str]:
        new = AXLES.sub(lambda found: OTHER_AXLE[found.group()], name)
        if new != name and new in self.names:
            yield new

    def _unheard(self, call: ast.Call) -> bool:
        """Whether a call only speaks to a reader, or only places what is drawn."""
        name = _called(call)
        return name in SPOKEN or (self.draws and name in PLACED)

    def _visit_all(self, nodes: list[ast.expr]) -> None:
        for node in nodes:
            self.visit(node)

    def _span(self, node: ast.expr | ast.stmt | ast.keyword) -> tuple[int, int]:
        assert node.end_lineno is not None and node.end_col_offset is not None
        start = self.starts[node.lineno - 1] + node.col_offset
        return start, self.starts[node.end_lineno - 1] + node.end_col_offset

    def _text(self, node: ast.expr) -> str:
        start, end = self._span(node)
        text = self.source[start:end].decode()
        loose = isinstance(node, ast.BinOp | ast.BoolOp | ast.Compare | ast.IfExp | ast.UnaryOp)
        return f"({text})" if loose else text

    def _between(self, start: int, end: int, new: str) -> str:
        """Return what stands between two operands (parentheses, comments), its operator new."""
        text = self.source[start:end].decode()
        return re.sub(OPERATOR, new, text, count=1)

    def _replace(self, kind: str, node: ast.expr | ast.stmt, new: str) -> None:
        self._add(kind, *self._span(node), new)

    def _add(self, kind: str, start: int, end: int, new: str) -> None:
        self.faults.append(Fault(self.file, kind, start, end, new))


def _called(node: ast.Call) -> str:
    if isinstance(node.func, ast.Attribute):
        return node.func.attr
    return node.func.id if isinstance(node.func, ast.Name) else ""


def _symmetric(node: ast.Call) -> bool:
    """Whether a call takes its arguments in any order; np.max(a, 0) and max(a, b, key=f) do not."""
    if isinstance(node.func, ast.Name) and node.func.id in ("min", "max"):
        return not node.keywords
    return _called(node) in SYMMETRIC and len(node.args) == 2


def _is_text(statement: ast.stmt) -> bool:
    return isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)


def _for_types(statement: ast.stmt) -> bool:
    """Whether a statement is for the type checker: `if TYPE_CHECKING`."""
    return isinstance(statement, ast.If) and "TYPE_CHECKING" in ast.unparse(statement.test)


def _type_alias(annotation: ast.expr) -> bool:
    return ast.unparse(annotation).endswith("TypeAlias")


def _type_expression(value: ast.Call | ast.Subscript) -> bool:
    """Whether a value is a type: NDArray[...], Callable[...], TypeVar(...)."""
    text = ast.unparse(value)
    return bool(re.match(r"(NDArray|Callable|Mapping|Sequence|tuple|dict|list)\[|TypeVar\(", text))


def _words(node: ast.expr) -> bool:
    """Whether an expression is text somewhere at its top."""
    if isinstance(node, ast.BinOp):
        return _words(node.left) or _words(node.right)
    return isinstance(node, ast.JoinedStr) or (
        isinstance(node, ast.Constant) and isinstance(node.value, str | bytes)
    )


def _plain(node: ast.BinOp) -> bool:
    """Whether one side is a bare number: in a drawing, a matter of size."""
    return isinstance(node.left, ast.Constant) or isinstance(node.right, ast.Constant)


def _counted(node: ast.expr) -> bool:
    """Whether a side of a comparison can be met exactly: a number, a length, a size."""
    if isinstance(node, ast.UnaryOp):
        return _counted(node.operand)
    if isinstance(node, ast.Call):
        return _called(node) == "len"
    if isinstance(node, ast.Attribute):
        return node.attr in ("size", "ndim")
    return isinstance(node, ast.Constant)
