"""Templates of prose and of build files: `@key@` is filled in, once, and not read again."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

from codegen.escape import cmake_comment, markdown

KEY = re.compile(r"@(\w+)@")
LANGUAGES: Mapping[str, Callable[[str], str]] = {  # by the ending of the template
    ".md": markdown,
    ".txt": cmake_comment,
}


@dataclass(frozen=True, slots=True)
class Words:
    """Words from data, such as the name of a car: no text of any language.
    text : any; a template takes it into comments and prose, escaped for its language.
    """

    text: str


Values = Mapping[str, str | Words]


def filled(template: Path, values: Values) -> str:
    """Return a template with every `@key@` replaced, once.
    template : a file; its ending tells the language.
    values : by key: text of that language, or `Words`, which are escaped for it.
    """

    def value(found: re.Match[str]) -> str:
        given = values[found[1]]
        return LANGUAGES[template.suffix](given.text) if isinstance(given, Words) else given

    return KEY.sub(value, template.read_text(encoding="utf-8"))
