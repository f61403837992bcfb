"""A result as text and as HTML from the same cells."""

import pytest

from armload_identification.result_table import PrintedResult, ResultTable

pytestmark = pytest.mark.pure


class Result(PrintedResult):
    def __init__(self, title, sentences):
        rows = [("mass", "12.5", "kg"), ("a<b", "1", "")]
        self.made = ResultTable(title, ("name", "value", "unit"), rows, (0, 2), sentences)

    def table(self):
        return self.made


@pytest.mark.parametrize(
    ("title", "sentences", "above", "below"),
    [("Arm & tool", ["It fits."], ["Arm & tool"], ["It fits."]), ("", [], [], [])],
)
def test_texts_are_aligned_left_numbers_right_without_spaces_at_the_end(title, sentences, above, below):
    text = str(Result(title, sentences))
    assert text.splitlines() == [*above, "name  value  unit", "mass   12.5  kg", "a<b       1", *below]
    assert repr(Result(title, sentences)) == text


def test_a_notebook_shows_the_same_with_everything_escaped():
    assert Result("Arm & tool", ["1 < 2"])._repr_html_() == (
        "<table><caption>Arm &amp; tool</caption><thead><tr>"
        '<th style="text-align:left">name</th><th style="text-align:right">value</th>'
        '<th style="text-align:left">unit</th></tr></thead><tbody>'
        '<tr><td style="text-align:left">mass</td><td style="text-align:right">12.5</td>'
        '<td style="text-align:left">kg</td></tr>'
        '<tr><td style="text-align:left">a&lt;b</td><td style="text-align:right">1</td>'
        '<td style="text-align:left"></td></tr></tbody></table><p>1 &lt; 2</p>'
    )


def test_a_notebook_shows_no_caption_without_a_title():
    assert Result("", [])._repr_html_().startswith("<table><thead>")
