"""Whether a case ended as it should: by a documented exit code, in a line, with all files."""

import csv
import hashlib
import math
import os
import re
import stat
from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from benchmarks.fuzz.server import CRASHED, Ended
from tireid.commands import BAD_INPUT, DONE, FAILS, NOT_TOLD, NOT_VALID

PACKAGES = "codegen|models|identifier|mpc|tireid"
FRAME = re.compile(rf'File ".*?((?:{PACKAGES})/[\w/]+\.py)", line (\d+)')
NUMBER = re.compile(r"(?<![\w.:/-])[-+]?(?:nan|inf(?:inity)?)(?![\w.:/-])", re.IGNORECASE)
NO_LIMIT = re.compile(r"\binf\b")  # as certificates say that there is none
NAME = re.compile(r"""^\s*"?name"?\s*[=:]\s*"([^"\n]{2,})"\s*,?\s*$""", re.MULTILINE)
CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f]")
GOOD = (DONE, FAILS)
CODES = (*GOOD, BAD_INPUT, NOT_TOLD)
DOCTOR = "doctor"  # which says by exit code 3 that a log is not right
JUDGES = ("identify", "predict", "compare")  # commands that say by exit code 3 that it is not valid
DEAD = 0.02  # of the stiffness of the linear tire
LONGEST_LINE = 1000  # letters that say what is wrong
OURS = ("out/summary.json", "out/deep/old.csv", "out/.tireid")  # of an earlier run: may be replaced


class Finding(NamedTuple):
    """What is wrong with a case: of a kind, at a place of the code or output, in words."""

    kind: str
    place: str
    told: str

    @property
    def key(self) -> tuple[str, str]:
        """What is one finding, however many cases show it."""
        return self.kind, self.place


def files_of(folder: Path) -> dict[str, str]:
    """Return the files of a user below a folder, by name, with what identifies their content.

    Parameters
    ----------
    folder : the working folder of a command.
    """
    found = {}
    for path in sorted(folder.rglob("*")):
        name, mode = path.relative_to(folder).as_posix(), path.lstat().st_mode
        if name in OURS or stat.S_ISDIR(mode):
            continue
        if stat.S_ISREG(mode):
            found[name] = hashlib.sha256(path.read_bytes()).hexdigest()
        else:
            found[name] = str(path.readlink()) if stat.S_ISLNK(mode) else "special"
    return found


def judge(
    words: Sequence[str],
    folder: Path,
    before: Mapping[str, str],
    ended: Ended,
    allowed: Collection[str] = (),
) -> list[Finding]:
    """Return what is wrong with the end of a case.

    Parameters
    ----------
    words : of the command.
    folder : its working folder.
    before : the user's files before it ran, of `files_of`.
    ended : how it ended.
    allowed : places where a number is not finite where all of the input is right.
    """
    found = [*_ending(words, ended), *_lost(words, folder, before), *_left(folder, before, ended)]
    if ended.stopped or (found and found[0].kind in ("traceback", "hang", "crash")):
        return found
    found += _output(words, ended)
    if ended.code in (*GOOD, NOT_VALID):
        found += [one for one in _numbers(words, folder, before, ended) if one.place not in allowed]
    return found


def _ending(words: Sequence[str], ended: Ended) -> list[Finding]:
    frames = FRAME.findall(ended.err)
    place = ":".join(frames[-1]) if frames else "?"
    if ended.hung:
        stuck = FRAME.findall(ended.trace)  # most recent call first
        return [Finding("hang", ":".join(stuck[0]) if stuck else "?", ended.trace[:2000])]
    if ended.stopped:
        return []  # much was asked for, and it said how far it came
    if "Traceback (most recent call last)" in ended.err or ended.code == CRASHED:
        last = ended.err.strip().splitlines()[-1:] or ["?"]
        return [Finding("traceback", place, last[0][:500])]
    if ended.code < 0:
        stuck = FRAME.findall(ended.trace)
        where = ":".join(stuck[0]) if stuck else "?"
        return [Finding("crash", f"{where} signal {-ended.code}", ended.trace[:2000])]
    said = "finding" if words[0] == DOCTOR else "NOT VALID"
    if ended.code == NOT_VALID and words[0] in (*JUDGES, DOCTOR) and said in ended.out:
        return []
    if ended.code not in CODES:
        return [Finding("exit code", str(ended.code), ended.err[-500:])]
    return []


def _lost(words: Sequence[str], folder: Path, before: Mapping[str, str]) -> list[Finding]:
    told = _written_file(words)
    after = files_of(folder)
    gone = [name for name in before if after.get(name) != before[name] and name != told]
    return [Finding("user file lost", words[0] if words else "", ", ".join(gone))] if gone else []


def _written_file(words: Sequence[str]) -> str:
    """Return the file that --force lets `init` replace."""
    if "--force" in words and "init" in words[:-1]:
        return words[words.index("init") + 1]
    return ""


def _left(folder: Path, before: Mapping[str, str], ended: Ended) -> list[Finding]:
    """Return scratch folders, and whatever a command that failed wrote."""
    if ended.stopped or ended.code < 0:
        return []  # it was killed
    scratch = sorted(
        path.name for path in folder.rglob(".*") if path.name.endswith((".part", "-claim"))
    )
    found = [Finding("left behind", "scratch", ", ".join(scratch))] if scratch else []
    new = sorted(set(files_of(folder)) - set(before))
    if ended.code == BAD_INPUT and new and not scratch:
        found.append(
            Finding("written and failed", new[0], f"{', '.join(new[:9])}; {ended.err[-300:]}")
        )
    return found


def _output(words: Sequence[str], ended: Ended) -> list[Finding]:
    found = []
    for name, text in (("standard output", ended.out), ("standard error", ended.err)):
        control = CONTROL.search(text)
        if control:
            around = text[max(control.start() - 60, 0) : control.end() + 60]
            found.append(Finding("control character", f"{name}, {words[0]}", repr(around)))
    lines = [line for line in ended.err.splitlines() if not line.startswith("  ")]
    if ended.code == BAD_INPUT and "--debug" not in words:
        good = len(lines) == 1 and "error: " in lines[0] and len(lines[0]) <= LONGEST_LINE
    else:
        good = not lines or "--debug" in words
    if not good:
        last = (lines or [""])[-1]
        what = f"{len(lines)} lines" if len(last) <= LONGEST_LINE else f"{len(last)} letters"
        warned = re.search(r"([\w/]+\.py:\d+): \w*Warning", ended.err)
        place = "/".join(warned[1].split("/")[-3:]) if warned else f"{words[0]}: {_sketch(last)}"
        found.append(Finding("not one line", place, f"{what}: {ended.err[:700]}"))
    return found


def _sketch(line: str) -> str:
    """Return a message without what is of the case."""
    words = re.sub(r"[^a-z ]+", "", line[:200].lower()).split()
    return " ".join([word for word in words if len(word) < 12][:8])


def _numbers(
    words: Sequence[str], folder: Path, before: Mapping[str, str], ended: Ended
) -> list[Finding]:
    """Return numbers that are not finite, and axles that no longer push."""
    found = [
        Finding("not finite", f"JSON {re.sub('[^/a-zA-Z_]', '', place)}", place)
        for place in ended.notes.get("not finite", [])[:3]
    ]
    said = ended.out
    for word in sorted({*words, *_names(folder, before)}, key=len, reverse=True):
        said = said.replace(word, "") if len(word) > 1 else said
    if words[0] == "check":
        said = NO_LIMIT.sub("", said)
    told = NUMBER.search(said)
    if told:
        line = said[said.rfind("\n", 0, told.start()) + 1 :].split("\n")[0]
        found.append(
            Finding("not finite", f"standard output of {words[0]}: {_sketch(line)}", line[:300])
        )
    for path in sorted(set(folder.rglob("*.csv"))):
        name = path.relative_to(folder).as_posix()
        if name not in before and path.is_file():
            column = _bad_column(path)
            if column:
                found.append(Finding("not finite", f"{path.name} {column}", name))
    for name, shares in ended.notes.get("frozen", {}).items():
        warned = ended.code == NOT_VALID or "--accept" in words
        if not warned and not all(math.isfinite(share) and share >= DEAD for share in shares):
            found.append(
                Finding("dead axle", " ".join(words[:1]), f"{name}: {shares} of the linear tire")
            )
    return found


def _names(folder: Path, before: Collection[str]) -> set[str]:
    """Return the names that the user's files give to cars: one may be called "nan"."""
    texts = [
        (folder / name).read_text(encoding="utf-8", errors="replace")
        for name in before
        if name.endswith((".toml", ".json")) and (folder / name).is_file()
    ]
    return {name for text in texts for name in NAME.findall(text)}


def _bad_column(path: Path) -> str:
    """Return the first column of a CSV with a number that is not finite; nothing if all are."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = csv.reader(file)
        header = next(rows, [])
        for row in rows:
            for name, cell in zip(header, row, strict=False):
                if cell.strip().lower().lstrip("+-") in ("nan", "inf"):
                    return name
    return ""


def writable(folder: Path) -> None:
    """Make a folder deletable, whatever a case did to it.

    Parameters
    ----------
    folder : of a case.
    """
    for root, _, _ in os.walk(folder):
        Path(root).chmod(0o700)
