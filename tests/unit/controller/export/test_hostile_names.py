"""Names from files cannot break out of what is written, whatever they contain."""

from __future__ import annotations

import re
from dataclasses import replace
from xml.etree import ElementTree

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from armload_controller.control_errors import ExportError
from armload_controller.export.format_registry import ExportFormat, exporter
from armload_controller.export.text_format import comment, xml_comment

PIECES = [
    "evil(",
    "\nevil(",
    "--",
    "---",
    "-->",
    "<!--",
    "<evil/>",
    "*/",
    "/*",
    "//",
    "#",
    '"',
    "'",
    "\\",
    "\n",
    "\r",
    "\x00",
    "\x1b[2J",
    "\u202e",
    "]]>",
    "&",
    "é",
]
NAMES = st.lists(st.one_of(st.sampled_from(PIECES), st.text(max_size=5)), max_size=12).map("".join)


@given(st.lists(NAMES, min_size=1, max_size=3))
@settings(max_examples=300)
def test_an_xml_comment_ends_where_it_should(paragraphs):
    """`arm---x` made an ill-formed comment, and `---><evil/><!--` an element."""
    lines = xml_comment(paragraphs)
    root = ElementTree.fromstring("\n".join(["<robot>", *lines, "</robot>"]))
    assert len(root) == 0
    assert not (root.text or "").strip()


@given(st.lists(NAMES, min_size=1, max_size=3), st.sampled_from(["//", "#", "!", ";", "%", "(*"]))
@settings(max_examples=200)
def test_every_line_of_a_comment_is_a_comment(paragraphs, prefix):
    lines = comment(paragraphs, prefix)
    assert all(line.startswith(prefix) and line.isascii() and line.isprintable() for line in lines)
    assert all(len(line.splitlines()) == 1 for line in lines)


APART = re.compile(
    r"/\*.*?\*/|//[^\n]*|\"(?:\\\\.|[^\"\n])*\"|'(?:\\\\.|[^'\n])*'|^\s*(?:[;!#%&]|\(\*|/)[^\n]*",
    re.DOTALL | re.MULTILINE,
)
"""Comments and quoted texts of the exported languages."""


def tags(text):
    return [element.tag for element in ElementTree.fromstring(text).iter()]


TESTED_ELSEWHERE = {ExportFormat.FMU, ExportFormat.FMU2, ExportFormat.HAL}
"""Compiled, with hostile names, by tests of their own."""
ALL_AT_ONCE = ("".join(PIECES), "---><evil(/>".join(PIECES[::-1]), "arm---x")


@pytest.mark.parametrize("form", [form for form in ExportFormat if form not in TESTED_ELSEWHERE])
@pytest.mark.parametrize("file", ALL_AT_ONCE)
def test_names_stay_in_comments_and_quotation_marks(make_subject, calibrated, form, file):
    """No name becomes an element, a statement or a line; it is refused or written as a name."""
    subject = calibrated if form is ExportFormat.THRESHOLDS else make_subject()
    plain = exporter(form)(subject)
    try:
        texts = exporter(form)(replace(subject, payload_file=file, robot=file))
    except ExportError:
        return
    assert len(texts) == len(plain)
    for (name, text), was in zip(texts.items(), plain.values(), strict=True):
        if isinstance(text, bytes):
            continue
        assert text.isascii(), name
        assert not set(text) & {chr(k) for k in range(32)} - {"\n", "\t"}, name
        if text.lstrip().startswith("<"):
            assert tags(text) == tags(was)
            continue
        assert "evil(" not in APART.sub("", text), name
