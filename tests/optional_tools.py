"""Tools that a machine with Python and gcc need not have: who asks for them, and a PATH without.

`python3 -m tests.optional_tools make demo` runs a command as if none of them were installed.
"""

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable
from fnmatch import fnmatchcase
from functools import wraps
from pathlib import Path
from typing import Any

TOOLS = (
    *("arm-none-eabi-*", "qemu-*", "x86_64-w64-mingw32-*", "clang*"),
    *("cmake", "ctest", "cppcheck", "g++*", "c++", "chromium*"),
)
# Files of tests that ask for one of them, a path a line: `make bare` runs these on such a PATH.
LIST = Path(__file__).with_name("optional_tools.txt")


def is_optional(command: str) -> bool:
    """Whether a command, by name or path, is one of the tools."""
    return any(fnmatchcase(Path(command).name, pattern) for pattern in TOOLS)


def listen(asked: set[str]) -> None:
    """From now on add to a set each command that this process looks for or runs."""

    def noted(call: Callable[..., Any], command: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(call)
        def wrapper(*words: Any, **options: Any) -> Any:
            asked.add(os.fsdecode(command(*words, **options)))
            return call(*words, **options)

        return wrapper

    def first(_: Any, args: Any, *__: Any, shell: bool = False, **___: Any) -> Any:
        if isinstance(args, str | bytes | os.PathLike):
            return os.fsdecode(args).split()[0] if shell else args
        return args[0]

    shutil.which = noted(shutil.which, lambda cmd, *_, **__: cmd)
    subprocess.Popen.__init__ = noted(subprocess.Popen.__init__, first)


def unlisted(file: str, asked: Iterable[str]) -> str | None:
    """What is wrong with a file of tests that asks for commands; None where nothing is."""
    tools = sorted({Path(command).name for command in asked if is_optional(command)})
    if not tools or file in LIST.read_text(encoding="utf-8").split():
        return None
    return f"{file} asks for {', '.join(tools)}: name it in {LIST.parent.name}/{LIST.name}"


def path_without(folders: str, scratch: Path) -> str:
    """A PATH that finds none of the tools: links to all else stand in for folders that hold one."""
    kept = []
    every = dict.fromkeys(Path(name) for name in folders.split(os.pathsep) if name)
    for number, folder in enumerate(every):
        commands = sorted(folder.iterdir()) if folder.is_dir() else []
        if any(is_optional(command.name) for command in commands):
            folder = scratch / str(number)
            folder.mkdir()
            for command in commands:
                if not is_optional(command.name):
                    (folder / command.name).symlink_to(command.absolute())
        kept.append(str(folder))
    return os.pathsep.join(kept)


def main(command: list[str]) -> int:
    if not command:
        print(__doc__, file=sys.stderr)
        return 2
    with tempfile.TemporaryDirectory(prefix="tireid-path-") as scratch:
        path = path_without(os.environ["PATH"], Path(scratch))
        return subprocess.run(command, env=os.environ | {"PATH": path}).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
