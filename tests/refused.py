"""The line that a file is refused with."""

import pytest


def line_about(path, error, read, *more):
    """What a reader says of a file that it refuses: one line, here without the path before it."""
    with pytest.raises(error) as caught:
        read(path, *more)
    message = str(caught.value)
    assert message.startswith(str(path)) and "\n" not in message
    return message.removeprefix(str(path))
