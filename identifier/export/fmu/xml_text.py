"""XML as text: elements with attributes in the order in which they are given."""

from codegen.escape import xml_attribute

DECLARATION = '<?xml version="1.0" encoding="UTF-8"?>\n'


def element(tag: str, attributes: dict[str, object], *children: str) -> str:
    """Return an element; attributes that are empty strings or None are left out.

    Parameters
    ----------
    tag : its name.
    attributes : by name; True and False become true and false.
    children : elements inside, one a line.
    """
    words = [
        f"{name}={xml_attribute(_text(value))}"
        for name, value in attributes.items()
        if value is not None and value != ""
    ]
    head = " ".join([tag, *words])
    if not children:
        return f"<{head}/>"
    inside = "\n".join(f"  {line}" for child in children for line in child.splitlines())
    return f"<{head}>\n{inside}\n</{tag}>"


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
