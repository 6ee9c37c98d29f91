"""Run what the pages show: `python docs/snippets.py [PAGE ...]`; `make docs` runs every page.

A page runs from top to bottom in a folder with the files of README's commands (`GIVEN`): Python in
one namespace, shell lines by bash, C by the compiler, TOML by its parser. A comment in the source
of a page changes what is done with the next block:

    <!-- run: rm -r * -->           commands of their own, which a reader need not see
    <!-- not run: needs a car -->   leaves it out and says why
    <!-- needs: cmake -->           leaves it out where there is no such program
    <!-- background -->             it runs until the page ends
    <!-- file: car.toml -->         it goes to the end of this file
    <!-- c: ... -->                 declarations that its C needs
    <!-- printed -->                its lines are of what the block before has printed
"""

import contextlib
import io
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import tomllib
import traceback
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
GIVEN = ("car.toml", "log.csv", "other.csv", "tire.json", "out/mine")
AT_ONCE = 2  # pages; more than two cores are rare where documents are made
LONGEST = 600  # s of a block: what takes longer hangs
ENDS = 60  # s from SIGINT to the end of what runs in the background
READ = ("text", "json", "sql", "matlab")  # languages of what is only read; Sphinx has {those}
# `make docs` has done these.
INSTALLS = re.compile(r"^(pip install |python3 -m venv |\. \.venv/).*$", re.M)
NUMBER = re.compile(r"-?\d+(\.\d+)?")
# A comment, or a block with its language.
PART = re.compile(
    r"<!-- (?P<word>run|not run|needs|background|file|c|printed):?(?P<rest>.*?)-->"
    r"|^(?P<indent> *)```(?P<language>\S*)\n(?P<code>.*?)^(?P=indent)```$",
    re.M | re.S,
)


class SnippetError(Exception):
    """What a page shows does not run."""


class Ran(NamedTuple):
    """Blocks of a page that ran, the reasons of those that did not, and the names that it left."""

    blocks: int
    left_out: list[str]
    names: dict[str, Any]


def parts(text: str) -> Iterator[tuple[str, str, str]]:
    """Yield word or language, content moved down to its lines, and place of each part of a page."""
    for found in PART.finditer(text):
        line = text.count("\n", 0, found.start()) + 1
        if found["word"]:
            yield found["word"], found["rest"].strip(), ""
        else:
            code = re.sub(f"^{found['indent']}", "", found["code"], flags=re.M)
            yield found["language"], "\n" * line + code, f"{line}"


def python(code: str, page: str, names: dict[str, Any]) -> str:
    """Run Python in the namespace of the page; return what it prints."""
    try:
        with contextlib.redirect_stdout(io.StringIO()) as out:
            exec(compile(code, page, "exec"), names)
        return out.getvalue()
    except Exception as error:
        lines = [f.lineno for f in traceback.extract_tb(error.__traceback__) if f.filename == page]
        line = error.lineno if isinstance(error, SyntaxError) else lines[-1]
        raise SnippetError(f"{page}:{line}: {type(error).__name__}: {error}") from error


def start(code: str, page: str) -> "subprocess.Popen[str]":
    """Start shell lines; the first that fails ends them and is named.

    They end by SIGINT also where this script does not, as in the background of a shell.
    """
    trap = f"trap 'echo \"{page}:$LINENO: exit code $?\" >&2' ERR; "
    return subprocess.Popen(
        ["bash", "-euc", trap + code],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        encoding="utf-8",
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )


def wait(shell: "subprocess.Popen[str]", page: str) -> str:
    """Wait for shell lines; return what they print."""
    try:
        out, _ = shell.communicate(timeout=LONGEST)
    except subprocess.TimeoutExpired:
        os.killpg(shell.pid, signal.SIGKILL)
        raise SnippetError(f"{page}: {shell.args[-1].strip()}: longer than {LONGEST} s") from None
    if shell.returncode:
        raise SnippetError("\n".join(out.splitlines()[-8:]))
    return out


def alike(shown: str, printed: str) -> bool:
    """Whether two lines are the same but for one in the last digit of a number, and blanks."""
    words = [line.split() for line in (shown, printed)]
    return len(words[0]) == len(words[1]) and all(
        abs(float(a) - float(b)) < 1.5 * 10.0 ** -len(a.partition(".")[2])
        if NUMBER.fullmatch(a) and NUMBER.fullmatch(b)
        else a == b
        for a, b in zip(*words, strict=True)
    )


def compare(shown: str, out: str, page: str) -> None:
    """Refuse a line of a page that was not printed."""
    for number, line in enumerate(shown.splitlines(), 1):
        if line.strip() and not any(alike(line, other) for other in out.splitlines()):
            raise SnippetError(f"{page}:{number}: is not printed: {line.strip()}")


def interrupt(shells: "list[subprocess.Popen[str]]", page: str) -> None:
    """End shell lines as Ctrl-C does; they may have ended well before."""
    for shell in shells:
        if shell.poll() is None:
            os.killpg(shell.pid, signal.SIGINT)
    failed = []
    for shell in shells:
        try:
            out, _ = shell.communicate(timeout=ENDS)
        except subprocess.TimeoutExpired:
            os.killpg(shell.pid, signal.SIGKILL)
            shell.communicate()
            out = f"{shell.args[-1].strip()}: runs on for {ENDS} s after SIGINT"
        if shell.returncode not in (0, 130, -signal.SIGINT):
            failed.append("\n".join([f"{page}: in the background:", *out.splitlines()[-8:]]))
    if failed:
        raise SnippetError("\n".join(failed))


def compile_c(code: str, before: str, page: str) -> None:
    """Compile C as the body of a function, with warnings as errors."""
    at = code.count("\n") - code.lstrip("\n").count("\n") + 1
    source = f'{before}\nvoid page(void)\n{{\n#line {at} "{page}"\n{code.strip()}\n}}\n'
    flags = ["-std=c99", "-Wall", "-Werror", "-fsyntax-only", "-xc", "-", "-I."]
    compiler = shlex.split(os.environ.get("CC", "gcc"))
    run = subprocess.run([*compiler, *flags], input=source, capture_output=True, encoding="utf-8")
    if run.returncode:
        raise SnippetError(run.stderr.strip())


def parse_toml(code: str, page: str, line: str) -> None:
    """Parse TOML."""
    try:
        tomllib.loads(code)
    except tomllib.TOMLDecodeError as error:
        raise SnippetError(f"{page}:{line}: {error}") from None


def run_page(path: Path, folder: Path) -> Ran:
    """Run a page in a folder."""
    page = path.relative_to(ROOT).as_posix() if path.is_relative_to(ROOT) else path.name
    names: dict[str, Any] = {"__name__": "__main__"}
    blocks, left_out, background, said, out = 0, [], [], {}, ""
    with contextlib.chdir(folder):
        try:
            for kind, content, line in parts(path.read_text(encoding="utf-8")):
                if kind == "run":
                    wait(start(content, page), page)
                    continue
                if not line:
                    said[kind] = content
                    continue
                reads = kind in READ or kind.startswith("{")
                if "needs" in said and shutil.which(said["needs"]) is None:
                    said["not run"] = f"needs {said['needs']}"
                if "not run" in said:
                    left_out.append(f"{page}:{line}: {said['not run']}")
                elif "file" in said:
                    with Path(said["file"]).open("a", encoding="utf-8") as file:
                        file.write(content.lstrip("\n"))
                elif kind == "python":
                    out = python(content, page, names)
                elif kind == "sh":
                    shell = start(INSTALLS.sub(":", content), page)
                    if "background" in said:
                        background.append(shell)
                    else:
                        out = wait(shell, page)
                elif kind == "c":
                    compile_c(content, said.get("c", ""), page)
                elif kind == "toml":
                    parse_toml(content, page, line)
                elif "printed" in said:
                    compare(content, out, page)
                elif not reads:
                    raise SnippetError(
                        f"{page}:{line}: nothing runs a block of {kind or 'no language'}"
                    )
                blocks += "not run" not in said and ("printed" in said or not reads)
                said = {}
        finally:
            interrupt(background, page)
    return Ran(blocks, left_out, names)


def give(start: Path, folder: Path) -> Path:
    """Put the files of README's commands into a folder."""
    folder.mkdir()
    for name in GIVEN:
        source, target = start / name, folder / name
        target.parent.mkdir(exist_ok=True)
        (shutil.copytree if source.is_dir() else shutil.copy)(source, target)
    return folder


def tried(path: Path, folder: Path) -> tuple[int, list[str], str]:
    """Run a page; return its counts and what is wrong."""
    try:
        ran = run_page(path, folder)
    except SnippetError as error:
        return 0, [], str(error)
    return ran.blocks, ran.left_out, ""


def main(pages: list[Path]) -> int:
    """Run README, then the pages; print what is left out, and what fails."""
    os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    os.environ["MPLBACKEND"] = "agg"
    with tempfile.TemporaryDirectory() as scratch:
        first = Path(scratch, "README")
        first.mkdir()
        results = [tried(ROOT / "README.md", first)]
        if not results[0][2]:
            others = [page for page in pages if page != ROOT / "README.md"]
            folders = [give(first, Path(scratch, f"{k}")) for k in range(len(others))]
            with ProcessPoolExecutor(AT_ONCE, get_context("spawn")) as pool:
                results += pool.map(tried, others, folders)
    left_out = [line for _, lines, _ in results for line in lines]
    failed = [error for *_, error in results if error]
    print(*(f"not run: {line}" for line in left_out), *failed, sep="\n")
    print(
        f"{sum(n for n, *_ in results)} snippets ran, {len(left_out)} did not, {len(failed)} failed"
    )
    return bool(failed)


if __name__ == "__main__":
    sys.exit(main([Path(one).resolve() for one in sys.argv[1:]] or PAGES))
