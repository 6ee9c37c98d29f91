"""Templates are filled once, and words from data are escaped for the language they enter."""

from html import unescape

import pytest

from codegen.template import Words, filled


def template(folder, text, name="file.md"):
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def test_what_was_filled_in_is_not_read_again(tmp_path):
    file = template(tmp_path, "@a@ and @b@")
    assert filled(file, {"a": "@b@", "b": "@a@"}) == "@b@ and @a@"
    text = filled(file, {"a": Words("@a@"), "b": Words("me@home@x")})
    assert unescape(text) == "@a@ and me@home@x"
    file = template(tmp_path, "@a@ and @b@", "file.txt")
    assert filled(file, {"a": Words("@b@"), "b": Words("@a@")}) == "@b@ and @a@"


def test_words_are_escaped_for_the_language_of_the_file(tmp_path):
    words = Words("*/ [x] <b>\n")
    got = {
        name: filled(template(tmp_path, "@w@", name), {"w": words})
        for name in ("a.md", "CMakeLists.txt")
    }
    assert got == {
        "a.md": "&#42;/ &#91;x&#93; &#60;b&#62;&#92;n",
        "CMakeLists.txt": "*/ (x) <b>\\n",
    }


def test_words_are_refused_where_the_language_is_not_known(tmp_path):
    for name in ("file.py", "file.c"):  # C is no template
        with pytest.raises(KeyError):
            filled(template(tmp_path, "@w@", name), {"w": Words("x")})
    with pytest.raises(KeyError):
        filled(template(tmp_path, "@unknown@"), {})
