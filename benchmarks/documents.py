"""Numbers in documents: each names the script and key that prints it, or says why it is given.

After a paragraph, list or table stands a comment that readers do not see, with one item for each
number above it, in their order:

    <!-- numbers learn_and_extrapolate: input=5 plant/over_floor/{least,most} target=1.3 -->

    script:          whose recorded values, benchmarks/results/<script>.json, the next keys are of;
                     tireid_paper has those of the tables that a test computes again,
                     fault_table_before what fault_table.py measured at the commit that the file
                     names, mpc_speed_before
                     instructions of a step there, and at the end
    key              measured: the number is the recorded value, rounded as it is printed
    key*1e3          times a factor, where the document has another unit
    key~3            rounded to three significant digits, as in 60 800
    a/{b,c}/{d,e}    as in a shell: a/b/d a/b/e a/c/d a/c/e
    key@target       the limit of a target that was reached; key@missed of one that was not, so
                     that a document whose words no longer hold is noticed
    reason=3.11,20   given, not measured; the reasons are those of `REASONS`

Code, names (C99, x86-64, ISO 3888-2), targets of links and other comments hold no numbers.
`python -m benchmarks.documents` writes the recorded values into README.md and docs, so that nobody
types them; it returns 1 where a number has no source. `--check` writes nothing.
After the comment `<!-- older -->` it writes which records measured other code than that of today
(`benchmarks/fingerprint.py`), up to the next empty line.
"""

import argparse
import difflib
import itertools
import json
import re
import sys
import textwrap
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from benchmarks.fingerprint import OWN, changed
from benchmarks.targets import RESULTS

ROOT = Path(__file__).resolve().parents[1]
COMMITTED = {
    "tireid_paper": ROOT / "tests" / "tireid" / "expected_tables.json",
    "fault_table_before": ROOT / "benchmarks" / "fault_table_before.json",
    "mpc_speed_before": ROOT / "benchmarks" / "mpc_speed_before.json",
}
REASONS = ("input", "target", "definition", "formula", "paper", "standard", "version", "name")
Values = Mapping[str, Mapping[str, float | int | str]]  # by script, by key

CODE = re.compile(r"^(```|~~~).*?^\1[^\n]*$|``[^`].*?``|`[^`\n]*`", re.M | re.S)
COMMENT = re.compile(r"<!--(.*?)-->", re.S)
LINK = re.compile(r"(?<=\])\([^)\n]*\)|<[^<>\n]+>")
NAME = re.compile(r"\bISO\s\d+(?:-\d+)?|[^\W\d]\w*\d\w*(?:[-.]\d+)*")
NUMBER = re.compile(
    r"(?:(?<![\w.)\]])[-−])?(?<![\w.])"  # a sign is one where nothing stands before it
    r"(?:\d+:\d+|\d+(?:\.\d+){2,}|\d{1,3}(?: \d{3})+(?!\d)|\d+(?:\.\d+)?(?:e[-+]?\d+)?)"
)
OLDER = re.compile(r"(?<=^<!-- older -->\n)(?:[^\n]+\n)*", re.M)
GIVEN = re.compile(r"(\w+)=(\S+)")
MEASURED = re.compile(r"([^\s*~=:]+?)(?:\*([\d.e+-]+))?(?:~(\d+))?")


class Number(NamedTuple):
    """A number of a document: where it stands, and how it is printed."""

    start: int
    text: str


class Item(NamedTuple):
    """Where a number is from: a reason and the text that was given, or script, key and scale."""

    reason: str = ""
    given: str = ""
    script: str = ""
    key: str = ""
    factor: float = 1.0
    digits: int | None = None

    @property
    def words(self) -> str:
        """What a reader is told of it."""
        return f"{self.reason}={self.given}" if self.reason else f"{self.script}: {self.key}"


class Mark(NamedTuple):
    """A comment with items, and the text [start, end) whose numbers it explains."""

    start: int
    end: int
    items: str


class NotationError(ValueError):
    """An item of a comment that cannot be read."""


def plain(text: str) -> str:
    """Return a document in which nothing but text is left; all else is filled, length kept.

    Parameters
    ----------
    text : Markdown.
    """
    for hidden in (CODE, COMMENT, LINK, NAME):
        text = hidden.sub(lambda found: re.sub(r"[^\n]", "\0", found[0]), text)
    return text


def numbers(text: str) -> list[Number]:
    """Return the numbers of a document in their order.

    Parameters
    ----------
    text : Markdown.
    """
    return [Number(found.start(), found[0]) for found in NUMBER.finditer(plain(text))]


def marks(text: str) -> list[Mark]:
    """Return the comments of a document that say where numbers are from.

    Parameters
    ----------
    text : Markdown.
    """
    found, before = [], 0
    code = CODE.sub(lambda block: re.sub(r"[^\n]", "\0", block[0]), text)
    for comment in COMMENT.finditer(code):
        words = comment[1].strip()
        if words.split(maxsplit=1)[:1] == ["numbers"]:
            end = len(code[: comment.start()].rstrip())
            start = max(before, code.rfind("\n\n", 0, end) + 1)
            found.append(Mark(start, comment.start(), words.removeprefix("numbers")))
        before = comment.end()
    return found


def expand(pattern: str) -> Iterator[str]:
    """Yield what a pattern with braces stands for, the first brace slowest.

    Parameters
    ----------
    pattern : as a/{b,c}.
    """
    parts = re.split(r"\{([^{}]*)\}", pattern)
    choices = [part.split(",") if k % 2 else [part] for k, part in enumerate(parts)]
    yield from ("".join(chosen) for chosen in itertools.product(*choices))


def read_items(words: str) -> list[Item]:
    """Return the items of a comment, one for each number.

    Parameters
    ----------
    words : what stands after `numbers`.

    Raises
    ------
    NotationError
        Where an item has another form, no reason or no script.
    """
    items, script = [], ""
    for word in words.split():
        if word.endswith(":"):
            script = word[:-1]
        elif given := GIVEN.fullmatch(word):
            if given[1] not in REASONS:
                raise NotationError(f"{word}: a reason is one of {', '.join(REASONS)}")
            items += [
                Item(reason=given[1], given=text.replace("_", " ")) for text in given[2].split(",")
            ]
        else:
            for key in expand(word):
                found = MEASURED.fullmatch(key)
                if found is None:
                    raise NotationError(f"{word}: neither key, key*factor, key~digits nor a reason")
                if not script:
                    raise NotationError(f"{word}: no script is named before it")
                digits = int(found[3]) if found[3] else None
                factor = float(found[2] or 1.0)
                items.append(Item(script=script, key=found[1], factor=factor, digits=digits))
    return items


def printed(value: float, like: str, digits: int | None = None) -> str:
    """Return a value as a document prints it.

    Parameters
    ----------
    value : in the unit of the document.
    like : the text that it replaces: as many decimals, the same form.
    digits : significant ones; None keeps the decimals.
    """
    mantissa, _, exponent = like.partition("e")
    decimals = len(mantissa.partition(".")[2])
    if exponent:
        return re.sub(r"e([-+])0*", lambda sign: "e" + sign[1].strip("+"), f"{value:.{decimals}e}")
    if digits is not None:
        value = float(f"{value:.{digits - 1}e}")
        decimals = max(0, digits - 1 - int(f"{value:e}".partition("e")[2]))
    text = f"{value:.{decimals}f}"
    if "." not in text and len(text.lstrip("-")) > 4:
        text = f"{int(text):,}".replace(",", " ")
    return text.replace("-", "−") if "−" in like else text


def wanted(item: Item, number: Number, values: Values) -> str:
    """Return the text that a number should have.

    Parameters
    ----------
    item : where it is from.
    number : as it is printed.
    values : what was recorded.

    Raises
    ------
    NotationError
        Where the script or the key has no recorded number.
    """
    if item.reason:
        return item.given
    if item.script not in values:
        raise NotationError(f"no benchmarks/results/{item.script}.json is recorded")
    value = values[item.script].get(item.key)
    if value is None:
        raise NotationError(f"{item.script} records no {item.key}")
    if isinstance(value, str):
        raise NotationError(f"{item.words} is no number but {value!r}")
    return printed(value * item.factor, number.text, item.digits)


def complaints(text: str, values: Values) -> list[tuple[int, str]]:
    """Return where a document and what was recorded differ: positions and what is wrong.

    Parameters
    ----------
    text : Markdown.
    values : by script and key.
    """
    wrong, open_numbers = [], {number.start: number for number in numbers(text)}
    for mark in marks(text):
        inside = [n for at, n in open_numbers.items() if mark.start <= at < mark.end]
        for number in inside:
            del open_numbers[number.start]
        try:
            items = read_items(mark.items)
        except NotationError as error:
            wrong.append((mark.end, str(error)))
            continue
        if len(items) != len(inside):
            named = ", ".join(number.text for number in inside)
            wrong.append((mark.end, f"{len(items)} items for {len(inside)} numbers: {named}"))
            continue
        for item, number in zip(items, inside, strict=True):
            try:
                right = wanted(item, number, values)
            except NotationError as error:
                wrong.append((number.start, str(error)))
                continue
            if right != number.text:
                wrong.append((number.start, f"{number.text} should be {right} ({item.words})"))
    wrong += [(at, f"{n.text} has no source") for at, n in open_numbers.items()]
    return sorted(wrong)


def rewritten(text: str, values: Values) -> str:
    """Return a document with the recorded values in the places of those that it prints.

    Parameters
    ----------
    text : Markdown; comments with as many items as numbers are served, others left.
    values : by script and key.
    """
    found, edits = numbers(text), []
    for mark in marks(text):
        inside = [number for number in found if mark.start <= number.start < mark.end]
        with suppress(NotationError):
            items = read_items(mark.items)
            if len(items) == len(inside):
                pairs = [p for p in zip(items, inside, strict=True) if not p[0].reason]
                edits += [(number, _known(item, number, values)) for item, number in pairs]
    for number, right in reversed(edits):
        text = text[: number.start] + right + text[number.start + len(number.text) :]
    return text


def _known(item: Item, number: Number, values: Values) -> str:
    """The text that a number should have; the one that it has where nothing is recorded."""
    with suppress(NotationError):
        return wanted(item, number, values)
    return number.text


def recorded(folder: Path = RESULTS) -> dict[str, dict[str, float | int | str]]:
    """Return what every benchmark recorded, and the tables of commands that tests keep.

    Parameters
    ----------
    folder : of the JSON files.

    Returns
    -------
    By script or command, by key.
    """
    found = {}
    for path in sorted(folder.glob("*.json")):
        text = json.loads(path.read_text(encoding="utf-8"))
        found[path.stem] = text["values"]
        for key, target in text.get("targets", {}).items():
            found[path.stem][f"{key}@{'target' if target['met'] else 'missed'}"] = target["limit"]
    for name, path in COMMITTED.items():
        found[name] = dict(flat(json.loads(path.read_text(encoding="utf-8"))))
    return found


def flat(tree: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, float | int | str]]:
    """Yield the leaves of nested tables, with their keys joined by slashes.

    Parameters
    ----------
    tree : the tables.
    above : key of the table itself.
    """
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{above}{key}/")
        else:
            yield f"{above}{key}", value


def older(folder: Path = RESULTS, root: Path = ROOT) -> dict[str, tuple[str, ...]]:
    """Return the records that are older than the code that they measured: which packages changed.

    Parameters
    ----------
    folder : of the JSON files.
    root : of the checkout.

    Returns
    -------
    By script; those whose code is that of today are left out.
    """
    found = {}
    for path in sorted(folder.glob("*.json")):
        code = json.loads(path.read_text(encoding="utf-8")).get("code", {})
        if since := changed(code, path.stem, root):
            found[path.stem] = since
    return found


def quoted(text: str) -> set[str]:
    """Return the scripts whose records a document quotes.

    Parameters
    ----------
    text : Markdown.
    """
    return {item.script for mark in marks(text) for item in read_items(mark.items) if item.script}


def listed(text: str, stale: Mapping[str, tuple[str, ...]]) -> str:
    """Return a document whose list of older records is the right one.

    Parameters
    ----------
    text : Markdown.
    stale : which packages changed, by script, as of `older`.
    """
    other = [f"`{name}`" for name, packages in stale.items() if OWN in packages]
    same = [f"`{name}`" for name, packages in stale.items() if OWN not in packages]
    words = (
        f"- by another script than that of today: {', '.join(other) or 'none'};",
        f"- by the script of today, on earlier packages: {', '.join(same) or 'none'}.",
    )
    lines = [
        textwrap.fill(one, 110, subsequent_indent="  ", break_on_hyphens=False) for one in words
    ]
    return OLDER.sub("\n".join(lines) + "\n", text)


def documents(root: Path = ROOT) -> list[Path]:
    """Return README.md and every Markdown file below docs.

    Parameters
    ----------
    root : of the project.
    """
    return [root / "README.md", *sorted((root / "docs").rglob("*.md"))]


def main(argv: list[str] | None = None) -> int:
    """Write recorded values into the documents; return 1 where something is still wrong.

    Parameters
    ----------
    argv : words of the command.
    """
    parser = argparse.ArgumentParser(description="Write recorded values into README.md and docs.")
    parser.add_argument("--check", action="store_true", help="write nothing")
    check, values, bad, stale = parser.parse_args(argv).check, recorded(), 0, older()
    for path in documents():
        old = path.read_text(encoding="utf-8")
        new = old if check else listed(rewritten(old, values), stale)
        name = path.relative_to(ROOT)
        if new != old:
            path.write_text(new, encoding="utf-8")
            before, after = old.splitlines(), new.splitlines()
            told = difflib.unified_diff(before, after, name.as_posix(), lineterm="", n=0)
            print("\n".join(told))
        for at, what in complaints(new, values):
            bad += 1
            print(f"{name}:{new.count(chr(10), 0, at) + 1}: {what}")
    for script, packages in stale.items():
        print(f"{script}: recorded before {', '.join(packages)} changed")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
