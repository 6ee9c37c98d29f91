"""The command line: one subcommand each for what a person wants to do."""

import argparse
import os
import signal
import sys
import traceback
from collections.abc import Sequence
from types import FrameType
from typing import NoReturn

BAD_INPUT = 2
INTERRUPTED = 130


class Parser(argparse.ArgumentParser):
    """A parser whose errors are one line, like all errors of tireid."""

    def error(self, message: str) -> NoReturn:
        """Print one line and exit with code 2.

        Parameters
        ----------
        message : what is wrong with the words.
        """
        print(f"{self.prog}: error: {message} (see {self.prog} --help)", file=sys.stderr)
        sys.exit(BAD_INPUT)


def build_parser() -> Parser:
    """Return the parser of all commands."""
    from tireid.commands import COMMANDS
    from tireid.summary import program_version

    parser = Parser(
        prog="tireid",
        description="Learns a car's lateral tire forces while it drives and freezes them.",
    )
    parser.add_argument("--version", action="version", version=f"tireid {program_version()}")
    parser.add_argument("--debug", action="store_true", help="show the traceback of an error")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for module in COMMANDS:
        module.add_parser(commands)
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Run a command; return 0, 1 where a check fails, or 2 where its input was bad.

    Parameters
    ----------
    arguments : words after `tireid`; None takes those of the process.
    """
    try:
        return _run(arguments)
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:  # who reads our output has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def _run(arguments: Sequence[str] | None) -> int:
    options = build_parser().parse_args(arguments)
    from tireid.progress import listen_to_library

    listen_to_library()
    try:
        status: int = options.run(options) or 0
        sys.stdout.flush()
    except BrokenPipeError:
        raise
    except (ValueError, ArithmeticError, OSError, ImportError) as error:
        if options.debug:
            traceback.print_exc()
        print(f"tireid {options.command}: error: {one_line(error)}", file=sys.stderr)
        return BAD_INPUT
    return status


def one_line(error: Exception) -> str:
    """Return what an error says, in one line; files are named first.

    Parameters
    ----------
    error : any error.
    """
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {(error.strerror or 'cannot be used').lower()}"
    return " ".join(str(error).split()) or type(error).__name__


def entry() -> NoReturn:
    """Run as a program: a termination cleans up as Ctrl-C does."""

    def stop(_number: int, _frame: FrameType | None) -> NoReturn:
        raise KeyboardInterrupt

    for name in ("SIGTERM", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), stop)
    sys.exit(main())


if __name__ == "__main__":
    entry()
