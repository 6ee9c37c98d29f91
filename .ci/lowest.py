"""Print the lowest versions that pyproject.toml allows, as constraints of pip: `name==bound`."""

import re
import sys
import tomllib
from pathlib import Path

EXTRAS = re.compile(r"(?P<name>[A-Za-z0-9_.-]+)\[(?P<extras>[^]]*)\]")
REQUIREMENT = re.compile(r"(?P<name>[A-Za-z0-9_.-]+)(\[[^]]*\])?>=(?P<bound>[0-9][0-9a-z.]*)")


def lowest(project: dict[str, object], extras: list[str]) -> list[str]:
    """Return constraints for the dependencies and those of the extras.

    Parameters
    ----------
    project : the table [project].
    extras : names of optional dependencies, whose bounds come before those of all.
    """
    bounds = {}
    for text in requirements(project, extras):
        found = REQUIREMENT.fullmatch(text)
        if found is None:
            sys.exit(f"pyproject.toml: {text!r} has no lower bound, as in name>=1.2")
        bounds[found["name"]] = found["bound"]
    return [f"{name}=={bound}" for name, bound in bounds.items()]


def requirements(project: dict[str, object], extras: list[str]) -> list[str]:
    """Return what the project asks for; an extra that names others of the project is all of them.

    Parameters
    ----------
    project : the table [project].
    extras : names of optional dependencies.
    """
    optional, always = project["optional-dependencies"], project["dependencies"]
    assert isinstance(optional, dict) and isinstance(always, list)
    wanted = list(always)
    left, seen = list(extras), set(extras)
    while left:
        for text in optional[left.pop(0)]:
            found = EXTRAS.fullmatch(text)
            if found is None or found["name"] != project["name"]:
                wanted.append(text)
                continue
            inner = [one.strip() for one in found["extras"].split(",")]
            left += [one for one in inner if one not in seen]
            seen.update(inner)
    return wanted


if __name__ == "__main__":
    table = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())
    print("\n".join(lowest(table["project"], sys.argv[1:])))
