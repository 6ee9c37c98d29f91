"""The command line: one subcommand each for what a person wants to do."""

import argparse
import gc
import io
import os
import shlex
import signal
import sys
import traceback
from collections.abc import Sequence
from types import FrameType
from typing import NoReturn

import tireid
from models.limits import VARIABLE, limits
from tireid.commands import (
    BAD_INPUT,
    COMMANDS,
    DONE,
    INTERRUPTED,
    NOT_TOLD,
    add_command,
    added,
    summary,
)
from tireid.progress import complain, flush_out, listen_to_library, unwritten

_LONGEST_LINE = 900  # characters of a message, command and option not counted
_CYCLES = 50_000  # objects between searches for garbage: imports and figures make many that stay


class _Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, like all errors of tireid."""

    def error(self, message: str) -> NoReturn:
        complain(f"{self.prog}: error: {one_line(message)} (see {self.prog} --help)")
        sys.exit(BAD_INPUT)


def build_parser(words: Sequence[str]) -> _Parser:
    """Return the parser of a command line: all commands, and the options of the one it names."""
    limits()  # refuses an environment that holds none
    parser = _Parser(
        prog="tireid",
        description="Turns a driving log into the car's tire curves, with error bars and a "
        "verdict. Begin with tireid demo, or with tireid sample and tireid identify. A command is "
        "explained by tireid COMMAND --help, words by docs/first_steps.md and docs/glossary.md.",
        epilog=f'Sizes are limited; an error names the limit, {VARIABLE}="samples=1e9" raises it.',
    )
    parser.add_argument("--version", action="store_true", help="show the version and exit")
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")
    commands = parser.add_subparsers(title="commands", dest="command", metavar="COMMAND")
    named = next((word for word in words if not word.startswith("-")), None)
    for name in (*COMMANDS, *(() if named in COMMANDS else added())):
        if name == named:
            add_command(name, commands)
        else:
            commands.add_parser(name, help=COMMANDS.get(name) or summary(name))
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return 0, 1 where a check fails, 2 where its input was bad, 3 where its answer
    is not valid, 74 where only standard output could not be written.

    arguments : words after `tireid`; None takes those of the process.
    """
    try:
        return _run(arguments)
    except KeyboardInterrupt:
        complain("interrupted")
        return INTERRUPTED


def _run(arguments: Sequence[str] | None) -> int:
    words = sys.argv[1:] if arguments is None else list(arguments)
    try:
        parser = build_parser(words)
    except ValueError as error:  # of the environment; of another's command
        complain(f"tireid: error: {one_line(error)}")
        return BAD_INPUT
    options = parser.parse_args(words)
    options.words = shlex.join(["tireid", *words])  # what a report says it was made by
    if options.version or options.command is None:
        print(f"tireid {tireid.__version__}" if options.version else parser.format_help().rstrip())
        return 0
    listen_to_library()
    try:
        status: int = options.run(options) or 0
    except _expected_errors() as error:
        if options.debug:
            complain(traceback.format_exc())
        complain(f"tireid {options.command}: error: {one_line(error)}")
        return BAD_INPUT
    flush_out()
    return NOT_TOLD if unwritten() and status == DONE else status


def _expected_errors() -> tuple[type[Exception], ...]:
    """Return what may go wrong without a fault in the program: input, system, compiler."""
    from codegen import processor
    from codegen.compiler import CompilationError, NoCompilerError
    from tireid.exporting import SelfTestError

    return (
        *(ValueError, ArithmeticError, OSError, ImportError, MemoryError),
        *(CompilationError, NoCompilerError, processor.ReplayError, SelfTestError),
    )


def one_line(error: Exception | str) -> str:
    """Return what an error says, in one line; files are named first."""
    if isinstance(error, OSError) and error.filename is not None:
        words = f"{error.filename}: {(error.strerror or 'cannot be used').lower()}"
    elif isinstance(error, OSError) and error.strerror:
        words = error.strerror.lower()  # as of a disk that is full
    else:
        words = str(error)
    text = " ".join(words.split()) or type(error).__name__
    if isinstance(error, MemoryError):
        text = f"not enough memory: {text}"
    return text if len(text) <= _LONGEST_LINE else f"{text[:_LONGEST_LINE]}..."


def entry() -> NoReturn:
    """Run as a program: a termination cleans up as Ctrl-C does."""
    gc.set_threshold(_CYCLES)
    _open_streams()
    os.environ["MPLBACKEND"] = "agg"  # nothing is shown, and that of a notebook may not be here

    def stop(_number: int, _frame: FrameType | None) -> NoReturn:
        raise KeyboardInterrupt

    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), stop)
    try:
        status: int | str | None = main()
    except SystemExit as ended:  # of --help and of wrong words
        status = ended.code
    flush_out()
    sys.exit(NOT_TOLD if unwritten() and not status else status)


def _open_streams() -> None:
    """Open what was closed, lest a file that we write become standard output; print any name."""
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the lowest number that is free
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


if __name__ == "__main__":
    entry()
