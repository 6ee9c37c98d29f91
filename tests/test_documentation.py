"""Docstrings name parameters that there are; those of the interface say what arrays hold."""

import ast
import inspect
import json
import re
from importlib import import_module
from pathlib import Path
from statistics import median
from types import ModuleType

import tireid as ti
from tests.sources import ROOT, texts_of, tree_of

PACKAGES = ("codegen", "models", "identifier", "mpc", "tireid")
DOCUMENTS = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
Documented = ast.FunctionDef | ast.ClassDef
# (n, 2), [rad]; or the words that send to where it is said: "as `errors` takes them".
SHAPE_OR_UNIT = r"\(.*\)|\[.+\]|`\w[\w.]*`"


def documented_parameters(docstring, *, inner=False):
    """What is said under "Parameters" of a numpy-style docstring, by name in order.

    Outside the interface entries stand below the summary, three spaces apart.
    """
    found = re.search(r"^Parameters\n-+\n(.*?)(?=^\w[^\n]*\n-+\n|\Z)", docstring, re.M | re.S)
    said = {}
    names = []
    if inner and not found:
        entry = r"(?:^|   )([\w*]+(?:, [\w*]+)*) : (.*?)(?=   [\w*]+(?:, [\w*]+)* : |$)"
        for one in re.finditer(entry, docstring, re.M):
            said |= dict.fromkeys(one[1].replace("*", "").split(", "), one[2])
    for line in found.group(1).splitlines() if found else []:
        head = re.match(r"^([\w*]+(?:, [\w*]+)*) : (.*)", line)
        if head:
            names = [name.lstrip("*") for name in head.group(1).split(", ")]
        for name in names:
            said[name] = said.get(name, "") + (head.group(2) if head else line)
    return said


def is_method(node):
    arguments = [*node.args.posonlyargs, *node.args.args]
    bound = "classmethod" in map(ast.unparse, node.decorator_list)
    return bool(arguments) and (arguments[0].arg == "self" or bound)


def actual_parameters(node):
    """Annotations of arguments of a function, or fields (else arguments of __init__) of a class."""
    if isinstance(node, ast.ClassDef):
        for item in node.body:
            if isinstance(item, ast.FunctionDef) and item.name == "__init__":
                return actual_parameters(item)
        fields = (item for item in node.body if isinstance(item, ast.AnnAssign))
        return {item.target.id: ast.unparse(item.annotation) for item in fields}
    arguments = node.args
    listed = [*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs]
    extra = [a for a in (arguments.vararg, arguments.kwarg) if a]
    shown = [*listed, *extra][is_method(node) :]
    return {a.arg: ast.unparse(a.annotation) if a.annotation else "" for a in shown}


def describes_itself(node):
    """Whether a class is a tuple with names, or a protocol: prose describes its fields."""
    return isinstance(node, ast.ClassDef) and bool(
        {ast.unparse(base) for base in node.bases} & {"NamedTuple", "Protocol"}
    )


def is_array(annotation):
    return bool({"Array", "ArrayLike"} & set(annotation.split(" | ")))


def is_overload(node):
    """Whether a function is only a signature for type checkers: its body has the docstring."""
    return "overload" in {ast.unparse(decorator) for decorator in node.decorator_list}


def documented_definitions(source):
    """Functions, classes and methods, each with the name of the top level that it belongs to."""
    found = []
    for node in tree_of(source).body:
        if isinstance(node, Documented):
            found.append((node, node.name))
            if isinstance(node, ast.ClassDef):
                methods = [item for item in node.body if isinstance(item, ast.FunctionDef)]
                found += [(item, node.name) for item in methods]
    return [(node, top) for node, top in found if not is_overload(node)]


def listed_names(page):
    """Module and name of what the tables of the API list."""
    found, module = [], ""
    tables = re.findall(r"^```\{eval-rst\}\n(.*?)^```$", page, re.M | re.S)
    for line in "".join(tables).splitlines():
        if line.startswith(".. currentmodule:: "):
            module = line.split()[-1]
        elif re.fullmatch(r"   \w+", line):
            found.append((module, line.strip()))
    return found


def interface():
    """Names of what `tireid` offers and its bases, by the file that defines them.

    With them classes that only the tables of the API name, by the module that they lie in.
    """
    offered = [getattr(ti, name) for name in ti.__all__]
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    offered += [
        getattr(import_module(module), name)
        for module, name in listed_names(page)
        if module != "tireid"
    ]
    for module in [one for one in offered if isinstance(one, ModuleType)]:
        offered += [value for name, value in vars(module).items() if not name.startswith("_")]
    named = {}
    for one in offered:
        for part in one.__mro__ if inspect.isclass(one) else [one]:
            if getattr(part, "__module__", "").split(".")[0] in PACKAGES and hasattr(
                part, "__qualname__"
            ):
                named.setdefault(Path(inspect.getfile(part)), set()).add(part.__qualname__)
    return named


def complaints(source, offered):
    """Drift between docstrings and signatures; what the interface leaves without a docstring, and
    its arrays of which no shape or unit is said.

    A parameter whose name and type say what it is needs no entry, nor does one that is not offered.
    """
    wrong = []
    for node, top in documented_definitions(source):
        docstring = ast.get_docstring(node)
        public = top in offered and not node.name.startswith("_")
        if docstring is None:
            wrong += [f"{node.name} has no docstring"] * public
            continue
        inner = not (public or describes_itself(node))
        documented = documented_parameters(docstring, inner=inner)
        actual = actual_parameters(node)
        if list(documented) != [name for name in actual if name in documented]:
            wrong.append(
                f"{node.name} documents {list(documented)}, its parameters are {list(actual)}"
            )
        wrong += [
            f"{node.name} says neither the shape nor the unit of {name}"
            for name, annotation in actual.items()
            if public and is_array(annotation) and not describes_itself(node)
            if not re.search(SHAPE_OR_UNIT, documented.get(name, ""))
            and not re.search(rf"`{name}` (?:{SHAPE_OR_UNIT})", docstring)
        ]
    return wrong


def test_documented_parameters_are_those_of_the_signature():
    offered = interface()
    wrong = [
        f"{path}: {line}"
        for package in PACKAGES
        for path, text in texts_of(package).items()
        for line in complaints(text, offered.get(ROOT / path, set()))
    ]
    assert not wrong, "\n".join(wrong)


def test_the_interface_is_what_tireid_names_with_its_bases():
    named = {name for names in interface().values() for name in names}
    assert named > {"Vehicle", "AxleIdentifier", "Method", "TireModel", "read_recording"}
    assert "Path" in named  # of `tireid.paths`
    assert named > {"Band", "Drives"}  # of `tire.band` and so on
    assert not named & {"Guide", "Scan", "gate"}


def test_a_drifted_docstring_is_caught():
    source = '''
def area(width, height):
    """Return the area.

    Parameters
    ----------
    width : of the thing [m].
    depth : of the thing [m].
    """

def ratio(above: float, below: float):
    """Return the ratio.

    Parameters
    ----------
    below : not zero [-].
    above : of any sign [-].
    """

def silent():
    pass

def product(width, height):
    """Return the product.

    width : of the thing [m].   length : of the thing [m].
    """

def volume(width: float, samples: Array, weights: ArrayLike | None):
    """Return the volume.

    Parameters
    ----------
    samples : what was
        measured.
    weights : of the samples
        (n,) [kg].
    """

@dataclass(frozen=True)
class Box:
    """A box."""

    width: float
    corners: Array

    def scaled(self, factor):
        """Return a larger box."""

class Corner(NamedTuple):
    """A corner, x and y [m]."""

    x: float
    y: Array
'''
    offered = {"silent", "volume", "Box", "Corner"}
    assert complaints(source, offered) == [
        "area documents ['width', 'depth'], its parameters are ['width', 'height']",
        "ratio documents ['below', 'above'], its parameters are ['above', 'below']",
        "silent has no docstring",
        "product documents ['width', 'length'], its parameters are ['width', 'height']",
        "volume says neither the shape nor the unit of samples",
        "Box says neither the shape nor the unit of corners",
    ]
    inner = [line for line in complaints(source, offered) if "documents" in line]
    assert complaints(source, set()) == inner


def missing_names(page):
    """Public names of `tireid` that the tables of the API do not list, and what else they list."""
    listed = {name for module, name in listed_names(page) if module == "tireid"}
    return {name for name in ti.__all__ if not name.startswith("_")} ^ listed


def test_the_page_of_the_api_lists_every_public_name():
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    assert missing_names(page) == set()
    assert missing_names(page.replace("   certify\n", "   cert\n")) == {"certify", "cert"}


def anchors(text):
    """Anchors of the headings of a page, as GitHub and the site make them."""
    titles = re.findall(r"^#+ (.*)$", re.sub(r"^```.*?^```$", "", text, flags=re.M | re.S), re.M)
    return {re.sub(r"[^\w\- ]", "", title.lower()).replace(" ", "-") for title in titles}


def dead_links(path, text):
    """Targets of relative links and pictures that are no file, or no heading of a page."""
    prose = re.sub(r"^```.*?^```$|`[^`\n]*`", "", text, flags=re.M | re.S)
    dead = []
    for target in re.findall(r"\]\(([^)\s]+)\)", prose):
        name, _, anchor = target.partition("#")
        if "://" in target:
            continue
        file = path.parent / name if name else path
        page = file.read_text(encoding="utf-8") if anchor and file.is_file() else ""
        if not file.is_file() or (anchor and anchor not in anchors(page)):
            dead.append(target)
    return dead


def test_links_of_documents_lead_to_files():
    for path in DOCUMENTS:
        assert not dead_links(path, path.read_text(encoding="utf-8")), path
    planted = "[a](docs/nowhere.md), [b](docs/index.md), [c](#tireid), [d](docs/limits.md#nothing)"
    assert dead_links(ROOT / "README.md", planted) == ["docs/nowhere.md", "docs/limits.md#nothing"]


PLAIN = 20, 45  # words of a sentence: below in the median, and at most
ASIDE = r"""<!--\ table.*?<!--\ end\ -->|<!--.*?-->   # tables that are written, comments
    |^(\ *)```.*?^\1```$|^(?:\#|\ *\||\(.*\)=).*?$   # code, headings, tables, targets of links"""


def sentences(text):
    """The words of each sentence of a page; code is one word, and an item of a list a sentence."""
    prose = re.sub(ASIDE, "", text, flags=re.M | re.S | re.X)
    prose = re.sub(r"`[^`]*`", "code", prose)
    prose = re.sub(r"!?\[([^]]*)\]\([^)]*\)", r"\1", prose)
    ends = r"(?<=[.!?])\s+|\n\s*\n|\n\s*(?:[-*]|\d+\.)\s"
    found = (re.findall(r"\S*\w\S*", one) for one in re.split(ends, f"\n{prose}"))
    return [words for words in found if words]


def text_of(path):
    text = path.read_text(encoding="utf-8")
    if path.suffix != ".ipynb":
        return text
    cells = (one for one in json.loads(text)["cells"] if one["cell_type"] == "markdown")
    return "\n\n".join("".join(one["source"]) for one in cells)


def long_sentences(text):
    """Sentences that are too long, or the median where that is."""
    counts = [(len(words), " ".join(words)) for words in sentences(text)]
    half = median([n for n, _ in counts] or [0])
    return [one for one in counts if one[0] > PLAIN[1]] + [half] * (half >= PLAIN[0])


def test_sentences_of_every_page_are_short():
    pages = [*DOCUMENTS, ROOT / "SECURITY.md", *(ROOT / "docs").rglob("*.ipynb")]
    wrong = {path.name: long_sentences(text_of(path)) for path in pages}
    assert not {name: found for name, found in wrong.items() if found}
    assert sentences("# A heading\n\nOne `two words` [three](x.md). Four.\n- Five\n| six |\n") == [
        ["One", "code", "three."],
        ["Four."],
        ["Five"],
    ]
    assert long_sentences(f"{'word ' * 46}.\nShort.")[0][0] == 46


def test_every_page_is_in_the_table_of_contents():
    index = (ROOT / "docs" / "index.md").read_text(encoding="utf-8")
    listed = set(re.findall(r"^[\w/]+$", index, re.M))
    files = [*DOCUMENTS[2:], *(ROOT / "docs").rglob("*.ipynb")]
    pages = {p.relative_to(ROOT / "docs").with_suffix("").as_posix() for p in files}
    assert listed == pages - {"index"}
