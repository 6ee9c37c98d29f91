"""Templates are filled once, and words from data are escaped for the language they enter."""

import pytest

from codegen.template import Words, filled


def template(folder, text, name="file.c"):
    (folder / name).write_text(text, encoding="utf-8")
    return folder / name


def test_what_was_filled_in_is_not_read_again(tmp_path):
    file = template(tmp_path, "@a@ and @b@")
    assert filled(file, {"a": "@b@", "b": "@a@"}) == "@b@ and @a@"
    assert filled(file, {"a": Words("@a@"), "b": Words("me@home@x")}) == "@a@ and me@home@x"


def test_words_are_escaped_for_the_language_of_the_file(tmp_path):
    words = Words("*/ [x] <b>\n")
    got = {
        name: filled(template(tmp_path, "@w@", name), {"w": words})
        for name in ("a.c", "a.h", "a.md", "CMakeLists.txt")
    }
    assert got == {
        "a.c": "* / [x] <b>\\n",
        "a.h": "* / [x] <b>\\n",
        "a.md": "&#42;/ &#91;x&#93; &#60;b&#62;&#92;n",
        "CMakeLists.txt": "*/ (x) <b>\\n",
    }


def test_words_are_refused_where_the_language_is_not_known(tmp_path):
    with pytest.raises(KeyError):
        filled(template(tmp_path, "@w@", "file.py"), {"w": Words("x")})
    with pytest.raises(KeyError):
        filled(template(tmp_path, "@unknown@"), {})
