from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from shipid.report.logs import input_ranges as envelope
from shipid.report.logs import repairs_table as repairs
from shipid.report.tables import TableCell, cell_html, number_cell, word_cell


def test_numbers_align_and_what_is_missing_sorts_last():
    assert number_cell(0.9, 2).text == "0.90"
    assert number_cell(-12.345, 1).text == "−12.3"
    assert number_cell(np.nan, 2).text == "–"
    assert number_cell(np.nan, 2).key > 1e200
    assert word_cell(None).text == word_cell(np.nan).text == word_cell(pd.NA).text == "–"


def test_envelope_and_repairs_hold_their_numbers(full_scale):
    table = envelope(full_scale)
    assert [row[0].text for row in table.rows] == ["train, all folds", "test"]
    assert table.columns[0] == "set"
    assert table.rows[1][1].text == "0.00 / 2.30 / 5.88"
    assert repairs(full_scale).takeaway == "2 repairs: repeated samples and jump in position."


WORDS = st.text(alphabet="aB é–1.<>&\"'", max_size=40)


@given(WORDS, st.floats(allow_nan=False) | WORDS, st.booleans(), st.booleans())
def test_a_cell_is_read_back_from_its_element(words, key, numeric, first):
    """Text and key survive HTML; a key that is left out is the text in small letters, as page.js reads it."""
    root = ElementTree.fromstring(cell_html(TableCell(words, key), numeric, first))
    assert (root.text or "") == words
    read = root.get("data-key", words.lower())
    expected = f"{key:.6g}" if isinstance(key, float) else key
    assert read == (expected or words.lower())
    assert ("words" in root.get("class", "").split()) != numeric
    assert (root.tag, root.get("scope")) == (("th", "row") if first else ("td", None))


@pytest.mark.parametrize(
    ("words", "style"),
    [
        ("a-family-of-models-with-a-long-name-1", "name"),
        ("gunnerus-identified-1 + memory-with-observer", "name"),
        ("each of the 32 damping derivatives times a factor", "long"),
        ("moderate-1 + memory", None),
    ],
)
def test_a_long_name_is_shown_whole(words, style):
    """Models whose names differ at the end alone looked alike."""
    classes = ElementTree.fromstring(cell_html(word_cell(words), numeric=False, first=False)).get("class").split()
    assert classes == ["words", *([style] if style else [])]
