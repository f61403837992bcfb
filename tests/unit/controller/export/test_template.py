"""Templates: fields are replaced, and comments cannot end early or run over the line."""

import pytest

from armload_controller.export import template

pytestmark = pytest.mark.pure


@pytest.fixture
def text(monkeypatch):
    """Makes a text the only template."""
    return lambda content: monkeypatch.setattr(template, "_text", lambda name: content)


def test_fields_are_replaced_and_a_missing_one_is_no_text(text):
    text("set(@name ${@{name}_dir})\n")
    assert template.filled("any", {"name": "arm"}) == "set(arm ${arm_dir})\n"
    with pytest.raises(KeyError):
        template.filled("any", {})


def test_a_comment_line_is_a_paragraph_and_other_lines_are_kept(text):
    text(f"# @what\nadd(@what) # @what\n#@what{' ' * 3}\n")
    first, *lines = template.written("any", "#", {"what": " ".join(["word"] * 60)}).splitlines()
    assert first.startswith("# word word")
    wrapped = [line for line in lines if line.startswith("# ")]
    assert wrapped
    assert max(map(len, [first, *wrapped])) <= 120
    assert sum(line.count("word") for line in [first, *wrapped]) == 60
    assert lines[len(wrapped)].startswith("add(word word")
