"""Print the lowest versions that pyproject.toml allows, as constraints of pip: `name==bound`."""

import re
import sys
import tomllib
from pathlib import Path

REQUIREMENT = re.compile(r"(?P<name>[A-Za-z0-9_.-]+)(\[[^]]*\])?>=(?P<bound>[0-9][0-9a-z.]*)")


def lowest(project: dict[str, object], extras: list[str]) -> list[str]:
    """Return constraints for the dependencies and those of the extras.

    Parameters
    ----------
    project : the table [project].
    extras : names of optional dependencies, whose bounds come before those of all.
    """
    optional = project["optional-dependencies"]
    assert isinstance(optional, dict)
    wanted = [*(project["dependencies"]), *(one for extra in extras for one in optional[extra])]
    bounds = {}
    for text in wanted:
        found = REQUIREMENT.fullmatch(text)
        if found is None:
            sys.exit(f"pyproject.toml: {text!r} has no lower bound, as in name>=1.2")
        bounds[found["name"]] = found["bound"]
    return [f"{name}=={bound}" for name, bound in bounds.items()]


if __name__ == "__main__":
    table = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text())
    print("\n".join(lowest(table["project"], sys.argv[1:])))
