"""Every fault that the rules know of a C file, found on its tokens.

Comments, texts and preprocessor lines are no tokens, so that a fault is planted in code alone. A
fault that leaves the sequence of tokens as it was is none.
"""

import re
from collections.abc import Callable, Iterator
from itertools import pairwise
from typing import NamedTuple

from benchmarks.mutation.faults import Fault
from benchmarks.mutation.python_faults import AXLES, OTHER_AXLE

TOKEN = re.compile(
    r"""(?P<skip>\s+|/\*.*?\*/|//[^\n]*|^[ \t]*\#(?:\\\n|[^\n])*)
    |(?P<text>"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*')
    |(?P<word>[A-Za-z_]\w*)
    |(?P<number>(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?[uUlLfF]*)
    |(?P<sign><<=|>>=|->|\+\+|--|<<|>>|[-+*/%&|^<>=!]=|&&|\|\||.)""",
    re.S | re.M | re.X,
)
SIGNS = {
    "<": (">=", "<="),
    "<=": (">", "<"),
    ">": ("<=", ">="),
    ">=": ("<", ">"),
    "==": ("!=",),
    "!=": ("==",),
    "&&": ("||",),
    "||": ("&&",),
    "+=": ("-=",),
    "-=": ("+=",),
    "*=": ("/=",),
    "/=": ("*=",),
    "++": ("--",),
}
BINARY = {"+": "-", "-": "+", "*": "/", "/": "*"}
CALLS = {"fmin": "fmax", "fmax": "fmin", "sin": "cos", "cos": "sin", "floor": "ceil"}
CALLS |= {"SQRT": "", "FABS": "", "fabs": "", "sqrt": "", "break": "continue"}
TRUTH = {"true": "false", "false": "true"}
JUMPS = {"return", "goto", "typedef", "extern", "static", "const", "else", "struct", "case"}


class Token(NamedTuple):
    """What it is (`word`, `number`, `text` or `sign`), its text, and its place in bytes."""

    kind: str
    text: str
    start: int
    end: int


def tokens(source: bytes) -> list[Token]:
    """Return what a compiler would read; comments and preprocessor lines are left out.

    Parameters
    ----------
    source : of a C file, ASCII.
    """
    found = TOKEN.finditer(source.decode("latin-1"))
    return [
        Token(str(match.lastgroup), match.group(), *match.span())
        for match in found
        if match.lastgroup != "skip"
    ]


def changes_tokens(source: bytes, planted: bytes) -> bool:
    """Return whether a compiler reads something else.

    Parameters
    ----------
    source : the original file.
    planted : the file with the fault.
    """
    before, after = ([token.text for token in tokens(text)] for text in (source, planted))
    return before != after


def c_faults(file: str, source: bytes) -> list[Fault]:
    """Return every fault of a file, in the order of its text.

    Parameters
    ----------
    file : path that the faults name.
    source : its content.
    """
    read = tokens(source)
    names = {token.text for token in read if token.kind == "word"}
    found = [
        Fault(file, kind, start, end, new)
        for rule in (_signs, _numbers, _words(names), _statements)
        for kind, start, end, new in rule(read)
    ]
    return sorted(set(found), key=lambda fault: (fault.start, fault.end, fault.new))


Change = tuple[str, int, int, str]


def _signs(read: list[Token]) -> Iterator[Change]:
    """Turn comparisons, logic and arithmetic; drop `!` and the minus of a value."""
    for before, token, after in zip(read, read[1:], read[2:], strict=False):
        if token.kind != "sign":
            continue
        for new in SIGNS.get(token.text, ()):
            kind = "logic" if new in ("&&", "||") else "comparison"
            yield (kind if token.text in _COMPARED else "arithmetic"), token.start, token.end, new
        value = before.kind in ("word", "number") or before.text in (")", "]")
        if token.text in BINARY and value and after.text not in (")", ",", "*"):
            if before.text not in _JUMPS_AND_TYPES and not before.text.startswith("tireid_"):
                yield "arithmetic", token.start, token.end, BINARY[token.text]
        elif token.text == "-" and not value:
            yield "sign", token.start, token.end, ""
        elif token.text == "!":
            yield "logic", token.start, token.end, ""


_COMPARED = {"<", "<=", ">", ">=", "==", "!=", "&&", "||"}
_JUMPS_AND_TYPES = {"return", "case", "double", "float", "int", "char", "void", "real", "sizeof"}


def _numbers(read: list[Token]) -> Iterator[Change]:
    """Change a number; take the other of two entries."""
    for before, token, after in zip(read, read[1:], read[2:], strict=False):
        if token.kind != "number":
            continue
        digits = re.match(r"[\d.]+(?:[eE][-+]?\d+)?", token.text)
        assert digits is not None
        value, suffix = digits.group(), token.text[digits.end() :]
        if before.text == "[" and after.text == "]" and value in ("0", "1"):
            yield "index", token.start, token.end, f"{1 - int(value)}{suffix}"
        elif "." in value or "e" in value.lower():
            new = repr(float(value) * 1.5) if float(value) else "1.0"
            yield "number", token.start, token.end, new + suffix
        else:
            yield "number", token.start, token.end, f"{int(value) + 1}{suffix}"


def _words(names: set[str]) -> Callable[[list[Token]], Iterator[Change]]:
    def rule(read: list[Token]) -> Iterator[Change]:
        """Call something near; take the other axle's; turn a truth."""
        for token in (token for token in read if token.kind == "word"):
            other = AXLES.sub(lambda found: OTHER_AXLE[found.group()], token.text)
            if other != token.text and other in names:
                yield "front and rear", token.start, token.end, other
            if token.text in CALLS:
                yield "near function", token.start, token.end, CALLS[token.text]
            if token.text in TRUTH:
                yield "truth", token.start, token.end, TRUTH[token.text]

    return rule


def _statements(read: list[Token]) -> Iterator[Change]:
    """Forget an assignment or a call."""
    begin = 0
    for k, token in enumerate(read):
        if token.text in ("{", "}") or (token.text == ")" and _ends_head(read, k)):
            begin = k + 1
        elif token.text == ";":
            statement = read[begin:k]
            begin = k + 1
            if _is_action(statement):
                yield "forgotten statement", statement[0].start, token.end, ";"


def _ends_head(read: list[Token], k: int) -> bool:
    """Whether a statement may follow: the parenthesis of `if`, `for` or `while` ends here."""
    depth = 0
    for back in range(k, -1, -1):
        depth += {")": 1, "(": -1}.get(read[back].text, 0)
        if depth == 0:
            return back > 0 and read[back - 1].text in ("if", "for", "while", "switch")
    return False


def _is_action(statement: list[Token]) -> bool:
    """Whether a statement assigns to what is there already, or calls; `(void)x` does nothing."""
    if not statement or (statement[0].kind != "word" and statement[0].text != "*"):
        return False
    texts = [token.text for token in statement]
    if texts[0] in JUMPS:
        return False
    at = next((k for k, text in enumerate(texts) if text in _ASSIGNED), None)
    if at is not None:  # two words in a row declare
        kinds = ["word", *(token.kind for token in statement[:at])]
        return sum(pair == ("word", "word") for pair in pairwise(kinds)) == 1
    return len(texts) > 2 and texts[1] == "(" and texts[-1] == ")"


_ASSIGNED = {"=", "+=", "-=", "*=", "/="}
