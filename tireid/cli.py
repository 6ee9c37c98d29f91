"""The command line: one subcommand each for what a person wants to do."""

import argparse
import sys
import traceback
from collections.abc import Sequence

from tireid import check_command, demo_command, identify_command, paper_command
from tireid.progress import listen_to_library
from tireid.summary import program_version

COMMANDS = (demo_command, paper_command, identify_command, check_command)
BAD_INPUT = 2


def build_parser() -> argparse.ArgumentParser:
    """Return the parser of all commands."""
    parser = argparse.ArgumentParser(
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
    options = build_parser().parse_args(arguments)
    listen_to_library()
    try:
        status: int = options.run(options) or 0
    except (ValueError, ArithmeticError, OSError, ImportError) as error:
        if options.debug:
            traceback.print_exc()
        line = " ".join(str(error).split()) or type(error).__name__
        print(f"tireid {options.command}: error: {line}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("interrupted; nothing was written", file=sys.stderr)
        return 130
    return status


if __name__ == "__main__":
    sys.exit(main())
