"""Short names are explained, words are left alone, and no text becomes a tag."""

from __future__ import annotations

import re

import pytest

from shipid.report.page import MEANINGS, mark_short_names


def plain(text: str) -> str:
    return re.sub(r"<[^>]*>", "", text)


@pytest.mark.parametrize("name", MEANINGS)
def test_every_short_name_is_explained(name: str) -> None:
    assert f">{name}</abbr>" in mark_short_names(f"its {name} = 3")


def test_words_are_left_alone() -> None:
    assert mark_short_names("A model and H-shaped bars at N_Dx") == "A model and H-shaped bars at N_Dx"
    assert mark_short_names("A model of 3 m").count("abbr") == 0


def test_no_text_becomes_a_tag() -> None:
    markup = mark_short_names('<b onclick="x">H_90</b> & more')
    assert "<b" not in markup
    assert plain(markup) == "&lt;b onclick=&#34;x&#34;&gt;H_90&lt;/b&gt; &amp; more"
