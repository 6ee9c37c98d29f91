"""Words from data: after its function every language reads them as words, whatever they hold."""

import html
import subprocess
from html.parser import HTMLParser
from shutil import which

import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from codegen import escape, find_compiler

PIECES = (
    *("a", " ", "*/", "/*", "//", "**//", "??/", "???/", "\\", "\\\n", "\n", "\r", "\r\n", "\t"),
    *('"', "'", "`", "$", "$x^$", "${HOME}", "$<1:x>", "$(id)", "@x@", "@title@", "#", "#[[", "]]"),
    *("[=[", "<b>", "</b>", "&amp;", "<!--", "-->", "]]>", "<?x", "|", "*", "_", "~~", "!", "{}"),
    *("%s", "%n", ";", "\x00", "\x07", "\x08", "\x1b[2J", "\x1b]0;x\x07", "\x7f", "\x85", "\x9b2J"),
    *("\u00e4", "\u2028", "\u2029", "\u202e", "\u2066", "\u200b", "\ufeff", "\ufffe", "\ud800"),
    *("\U0001f697", "\U000e0041", "\u5bf8"),
)
HOSTILE = [
    *(chr(code) for code in range(0x180)),
    *PIECES,
    *(first + second for first in PIECES for second in PIECES),
]
CONTROLS = {chr(code) for code in (*range(0x20), 0x7F, *range(0x80, 0xA0))}
FUNCTIONS = [
    getattr(escape, name)
    for name in (
        *("visible", "c_comment", "c_string", "cmake_comment", "markdown"),
        *("html", "mathtext", "terminal"),
    )
]


def test_a_name_of_letters_is_left_alone():
    for text in ("sedan", "Audi A3, 2.0 (2019)", "Škoda", "two words"):
        assert {f(text) for f in (escape.visible, escape.c_comment, escape.cmake_comment)} == {text}
        assert {f(text) for f in (escape.markdown, escape.html, escape.terminal)} == {text}


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda f: f.__name__)
def test_nothing_that_does_not_print_comes_through(function):
    for text in HOSTILE:
        got = function(text)
        assert not (CONTROLS - {"\n"}) & set(got)
        assert not set("\u202e\u2066\u2028\u200b\ufeff\U000e0041") & set(got)
        got.encode("utf-8")  # no halves of pairs
        if function not in (escape.html, escape.terminal):
            assert "\n" not in got


@pytest.fixture(scope="module")
def gcc():
    compiler = find_compiler()
    if compiler is None:
        pytest.skip("needs a C compiler")
    return compiler


def answer_of(compiler, source, folder, *flags):
    file = folder / "file.c"
    file.write_bytes(source.encode("utf-8", "surrogatepass"))
    command = [*compiler, "-std=c99", "-trigraphs", *flags, str(file)]
    return subprocess.run(command, capture_output=True, text=True, cwd=folder, check=False)


def test_no_words_leave_a_comment_of_c(gcc, tmp_path):
    flags = ("-Wall", "-Wextra", "-Werror", "-fsyntax-only")
    lines = [f"/* {escape.c_comment(text)} */ int a{i};\n" for i, text in enumerate(HOSTILE)]
    answer = answer_of(gcc, "".join(lines), tmp_path, *flags)
    assert answer.returncode == 0, answer.stderr[:500]
    expanded = answer_of(gcc, "".join(lines), tmp_path, "-E", "-P").stdout
    assert expanded.split() == [word for i in range(len(HOSTILE)) for word in ("int", f"a{i};")]
    assert answer_of(gcc, "/* a */ int b; */ int a;\n", tmp_path, *flags).returncode != 0


def test_a_c_string_holds_what_was_said(gcc, tmp_path):
    said = [text for text in HOSTILE if "\x00" not in text and "\ud800" not in text]
    rows = "".join(f'    "{escape.c_string(text)}",\n' for text in said)
    source = (
        "#include <stdio.h>\nstatic const char *const said[] = {\n"
        f"{rows}}};\nint main(void) {{\n    unsigned i;\n"
        '    for (i = 0; i < sizeof said / sizeof *said; i++) printf("%s\\001", said[i]);\n'
        "    return 0;\n}\n"
    )
    answer = answer_of(gcc, source, tmp_path, "-Wall", "-Wextra", "-Werror", "-o", "say")
    assert answer.returncode == 0, answer.stderr[:500]
    printed = subprocess.run([tmp_path / "say"], capture_output=True, check=True).stdout
    assert printed == b"".join(text.encode() + b"\x01" for text in said)


@pytest.mark.skipif(which("cmake") is None, reason="needs cmake")
def test_no_words_leave_a_comment_of_cmake(tmp_path):
    order = "\nexecute_process(COMMAND ${CMAKE_COMMAND} -E touch ran)\n#"
    script = tmp_path / "script.cmake"
    hostile = [*HOSTILE, order, f"[[\n]]{order}", f"\r{order}", f"\u2028{order}"]

    def run(texts):
        lines = [f"# {text}: a library.\n" for text in texts]
        lines.append("file(WRITE done yes)\n")
        script.write_bytes("".join(lines).encode("utf-8", "surrogatepass"))
        command = ["cmake", "-P", script.name]
        return subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)

    answer = run(map(escape.cmake_comment, hostile))
    assert answer.returncode == 0, answer.stderr
    assert answer.stderr == ""
    assert (tmp_path / "done").exists()
    assert not (tmp_path / "ran").exists()
    run([order])
    assert (tmp_path / "ran").exists()  # what the function keeps out


def test_markdown_shows_the_words_and_means_nothing():
    for text in HOSTILE:
        got = escape.markdown(text)
        assert html.unescape(got) == escape.visible(text)
        assert not escape.MARKDOWN & set(got.replace("&#", "")), text


class Reader(HTMLParser):
    def __init__(self):
        super().__init__()
        self.tags, self.data, self.attributes = [], "", []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs

    def handle_data(self, data):
        self.data += data


def test_html_gives_the_words_back():
    for text in HOSTILE:
        reader = Reader()
        reader.feed(f'<p id="{escape.html(text)}">{escape.html(text)}</p>')
        reader.close()
        shown = escape.visible(text, keep="\n")
        assert (reader.tags, reader.data) == (["p"], shown)
        assert reader.attributes == [("id", shown)]


@pytest.mark.parametrize("text", ["$x^$", "$\\frac$", "a$b", "\\$a$", "$$", "cost: 5 $ or 6 $"])
def test_a_dollar_begins_no_formula(text):
    def drawn(words, **options):
        figure = Figure(figsize=(2, 0.5))
        figure.text(0.1, 0.5, words, **options)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        return bytes(canvas.buffer_rgba())

    assert drawn(escape.mathtext(text)) == drawn(text, parse_math=False)
    assert drawn(escape.mathtext(text)) != drawn("")
