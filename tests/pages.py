"""What a browser would see of a page, and what is wrong with it whatever it reports."""

from html.parser import HTMLParser

VOID = {"meta", "img", "wbr"}


class Outline(HTMLParser):
    """What a browser would see: elements in order, links, texts; complains of a wrong nesting."""

    def __init__(self):
        super().__init__()
        self.open = []
        self.tags = []
        self.text = ""

    def handle_starttag(self, tag, attrs):
        self.tags.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if not {"style", "script"} & {*self.open}:
            self.text += data


def outline(page):
    parser = Outline()
    parser.feed(page)
    assert parser.open == []
    return parser


def faults_of(page):
    """What is wrong with a page whatever it reports: anchors, pictures without words, raw text."""
    parser = outline(page)
    ids = [attributes["id"] for _, attributes in parser.tags if "id" in attributes]
    found = [f"id twice: {one}" for one in set(ids) if ids.count(one) > 1]
    for tag, attributes in parser.tags:
        if tag == "a" and str(attributes["href"]).removeprefix("#") not in ids:
            found.append(f"leads nowhere: {attributes['href']}")
        if tag == "img" and not str(attributes.get("alt") or "").strip():
            found.append("a picture without words")
    if "`" in parser.text:
        found.append("a back-tick")
    return found
