from __future__ import annotations

import base64
import hashlib
import itertools
import json
import re
import zlib
from dataclasses import replace
from html.parser import HTMLParser
from importlib.resources import files
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from plotly.offline import get_plotlyjs_version

from shipid.report import AnswerSentence, ReportContent, write_report
from shipid.report.figure import PageFigure
from shipid.report.page import MEANINGS, Section, draw_sections, mark_short_names, render_page
from shipid.report.paths import window_data
from shipid.report.sections import SECTIONS
from shipid.report.tables import PageTable
from tests.report.views import views

NASTY = "<script>alert('x')</script>"
VOID = {"meta", "input", "br", "link", "img"}


class Page(HTMLParser):
    """Elements of a page: (tag, attributes, text) in the order in which they open."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None], list[str]]] = []
        self.open: list[tuple[str, dict[str, str | None], list[str]]] = []
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes), []))
        if tag not in VOID:
            self.open.append(self.elements[-1])

    def handle_endtag(self, tag):
        assert self.open.pop()[0] == tag, f"</{tag}> closes another element"

    def handle_data(self, data):
        for element in self.open:
            element[2].append(data)

    def all(self, *tags):
        return [(attributes, "".join(text)) for tag, attributes, text in self.elements if tag in tags]


def render(content: ReportContent) -> str:
    return render_page("study", SECTIONS, content, window_data(content) if content.snapshots else None)


def every_panel(item):
    return [panel for panels in views(item).values() for panel in panels] if isinstance(item, PageFigure) else []


def unpacked(data: str) -> str:
    return zlib.decompress(base64.b64decode(data, validate=True)).decode()


@pytest.fixture(scope="module")
def pages(simulation, full_scale):
    return {
        content.name: (content, text, Page(text)) for content in (simulation, full_scale) for text in [render(content)]
    }


def bare_content(whole: ReportContent, name: str) -> ReportContent:
    """A study with its cells and models alone."""
    return ReportContent(title="Question?", name=name, cells=whole.cells, naive=whole.naive, models=whole.models)


@pytest.fixture(scope="module")
def plain(full_scale):
    """A study that draws little: one cell table, one figure over N_D, the provenance."""
    content = bare_content(full_scale, "plain")
    return replace(content, horizon=full_scale.horizon, provenance=full_scale.provenance)


@pytest.fixture(params=[0, 1], ids=["simulation", "full scale"])
def page(request, pages):
    return list(pages.values())[request.param]


def test_one_plotly_and_a_file_that_fits_a_mail(page):
    _, text, parsed = page
    assert text.count("* plotly.js (cartesian - minified) v") == 1, "its notice is there to read"
    assert "Licensed under the MIT license" in text
    (script,) = (data for a, data in parsed.all("script") if a.get("id") == "plotly")
    assert unpacked(script) == files("shipid.report").joinpath("vendor/plotly-cartesian.min.js").read_text("utf-8")
    assert len(text.encode()) < 2_000_000
    assert not parsed.open, "every element is closed"


def test_the_vendored_plotly_is_the_one_that_is_recorded_and_draws_the_figures_of_the_package():
    folder = files("shipid.report").joinpath("vendor")
    script = folder.joinpath("plotly-cartesian.min.js").read_bytes()
    record = folder.joinpath("README.md").read_text(encoding="utf-8")
    assert hashlib.sha256(script).hexdigest() in record
    version = re.search(rb"plotly.js \(cartesian - minified\) v([0-9.]+)", script[:200])
    assert f"plotly.js {version[1].decode()}" in record
    assert version[1].decode().partition(".")[0] == get_plotlyjs_version().partition(".")[0], "figures are made for it"
    assert b"</script" not in script


def test_nothing_is_fetched(page):
    _, _text, parsed = page
    for tag, attributes, _ in parsed.elements:
        assert "src" not in attributes
        assert "srcset" not in attributes
        assert tag not in ("link", "iframe", "object", "img")
        assert (attributes.get("href") or "#").startswith("#")
        assert not any(name.startswith("on") for name in attributes)
    (style,) = (style for _, style in parsed.all("style"))
    assert "url(" not in style
    assert "@import" not in style
    policy = next(a["content"] for a, _ in parsed.all("meta") if a.get("http-equiv") == "Content-Security-Policy")
    assert policy.startswith("default-src 'none'")
    assert "http" not in policy


def test_names_of_the_user_stay_text(page, simulation, simulation_drawn, full_scale_drawn):
    content, text, parsed = page
    sections = simulation_drawn if content is simulation else full_scale_drawn
    assert NASTY not in text
    # A name that became an element would be one script more.
    with_views = [s for s in sections for i in s.items if isinstance(i, PageFigure) and not i.browser]
    assert len(parsed.all("script")) == len(with_views) + 3
    packed = [(a, data) for a, data in parsed.all("script") if a.get("type") == "text/plain"]
    assert len(packed) == len(with_views) + 2, "all but the script of the page"
    for attributes, data in packed:
        if attributes.get("id") != "plotly":
            json.loads(unpacked(data))


def test_every_model_run_and_finding_is_named(page):
    content, _, parsed = page
    words = " ".join(text for _, text in parsed.all("body"))
    expected = [
        *content.models.model,
        *{s.run for s in content.snapshots},
        content.title,
        content.name,
        content.command,
    ]
    expected += [part for f in content.findings for part in (f["id"], f["claim"], f["verdict"])]
    expected += [part for item in content.provenance.items() for part in item]
    assert [name for name in expected if name not in words] == []
    assert content.study_document in words


def test_a_failed_cell_says_so(full_scale, pages):
    _, _, parsed = pages[full_scale.name]
    (row,) = (text for _, text in parsed.all("tr") if "diverged: 4 % of the test windows left the sea" in text)
    assert row.split("\n")[1:3] == [f"bare hull {NASTY}", "6.40"]
    assert row.count("–") == 5  # H_end, H_end_90, H, H_90, rms
    assert any("Not plotted: bare hull" in text for _, text in parsed.all("figcaption"))


def test_sentences_link_to_what_is_there(page):
    content, _, parsed = page
    ids = [attributes["id"] for _, attributes, _ in parsed.elements if "id" in attributes]
    assert len(ids) == len(set(ids))
    assert {a["href"][1:] for a, _ in parsed.all("a")} <= set(ids)
    answers = [text for _, text in parsed.all("li") if "Figure" in text and "With 30" in text]
    assert len(answers) == 1
    # A map needs several N_D; an item is not drawn without what it needs.
    parts = {*vars(content), *content.frames}
    able = {name for one in SECTIONS.values() for name, (_, need) in one.items.items() if need in parts}
    assert able - set(ids) == (set() if content.cells.N_D.nunique() > 1 else {"map"})


def test_three_sentences_come_before_the_details_and_warnings_are_open(plain):
    for texts, summary in (
        (["One.", "Two.", "Three."], ""),
        (["One.", "Two.", "Three.", "Four."], '<details class="more">\n<summary>In detail (1 more sentence)'),
        (["One.", "Two.", "Three.", "Careful: x."], '<details class="more" open>'),
    ):
        header = render(replace(plain, answer=[AnswerSentence(text) for text in texts])).partition("<nav")[0]
        lead, _, rest = header.partition("<details")
        assert [text in lead for text in texts] == [i < 3 for i in range(len(texts))]
        assert all(text in header for text in texts)
        assert summary in header
        assert bool(rest) == bool(summary)


def test_a_link_to_a_figure_without_data_is_left_out(plain):
    linked = replace(plain, answer=[AnswerSentence("Errors grow.", "horizon")])
    assert "#horizon" in [a["href"] for a, _ in Page(render(linked)).all("a")]
    bare = replace(linked, horizon=linked.horizon.iloc[:0])
    assert "#horizon" not in [a["href"] for a, _ in Page(render(bare)).all("a")]


def test_structure_for_those_who_listen(page):
    _, text, parsed = page
    assert '<html lang="en">' in text
    levels = [int(tag[1]) for tag, _, _ in parsed.elements if re.fullmatch("h[1-6]", tag)]
    assert levels[0] == 1
    assert levels.count(1) == 1
    assert all(b - a <= 1 for a, b in itertools.pairwise(levels)), "no heading level is skipped"
    assert {"header", "nav", "main", "footer"} <= {tag for tag, _, _ in parsed.elements}
    labelled = {a.get("for") for a, _ in parsed.all("label")}
    for attributes, _ in parsed.all("select"):
        assert attributes["id"] in labelled
    for attributes, _ in parsed.all("input"):
        assert attributes["type"] == "radio" or attributes["id"] in labelled
    assert all(a.get("scope") in ("col", "row") for a, _ in parsed.all("th"))
    plots = [a for a, _ in parsed.all("div") if a.get("class") == "plot"]
    assert plots
    assert all(a["role"] == "img" and len(a["aria-label"]) > 40 for a in plots)


def test_every_figure_speaks(sections):
    for section in sections:
        for item in section.items:
            if isinstance(item, PageFigure):
                assert re.search(r"\d.*\.$", item.takeaway), item.id
                assert re.fullmatch(r"(\S+ )+\S+\.", item.how), item.id


@pytest.mark.slow
def test_numbers_are_written_for_people(page):
    """No exponent, no not-a-number, no more digits than mean something, no name of a column, no mark of markdown."""
    content, _, parsed = page
    prose = [text for _, text in parsed.all("p", "figcaption", "th", "button", "h3", "option", "legend")]
    prose += [text for a, text in parsed.all("td") if not a.get("class")]
    prose += [str(a[key]) for _, a, _ in parsed.elements for key in ("aria-label", "title") if a.get(key)]
    assert len(prose) > 100
    strange = re.compile(
        r"\d[eE][+-]?\d|\b(nan|inf|None)\b|\+-|\d\.\d{6,}|`|\b\d+\.\d+ \d+(\.\d+)?\b|\b[a-z]{2,}_[a-z]{2,}"
    )
    given = {content.command, *content.cells.hyperparameters, *content.cells.sentence}
    assert [text for text in prose if strange.search(text) and not any(one and one in text for one in given)] == []


def test_axes_have_units(sections):
    seen = 0
    for section in sections:
        for item in section.items:
            for panel in every_panel(item):
                for name, drawn_axis in panel.layout.to_plotly_json().items():
                    if re.fullmatch(r"[xy]axis\d*", name):
                        named = (
                            drawn_axis.get("ticktext")
                            or drawn_axis.get("showticklabels") is False
                            or drawn_axis.get("visible") is False
                        )
                        assert named or re.search(r"\S \[[^\]]+\]$", drawn_axis["title"]["text"]), (item.id, name)
                        seen += 1
    assert seen > 20


def test_it_is_written_from_cells_alone(full_scale):
    content = bare_content(full_scale, "bare")
    page = Page(render(content))
    assert [a["id"] for a, _ in page.all("figure")] == ["gain"]


def test_it_is_written_when_every_cell_failed(full_scale):
    cells = full_scale.cells.assign(H=np.nan, H_90=np.nan, rms=np.nan, status="failed", sentence="no memory left")
    text = render(replace(full_scale, cells=cells, answer=()))
    assert "No cell gave a result." in text
    assert "failed: no memory left" in text


def test_write_report(tmp_path, plain):
    file = write_report(plain, tmp_path / "new" / "report.html")
    assert file.read_text(encoding="utf-8").startswith("<!doctype html>")
    with pytest.raises(FileExistsError):
        write_report(plain, file / "report.html")


def without_tags(text: str) -> str:
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
    assert without_tags(markup) == "&lt;b onclick=&#34;x&#34;&gt;H_90&lt;/b&gt; &amp; more"


EMPTY = pd.DataFrame()
FULL = pd.DataFrame({"a": [1.0]})


def table(name: str) -> PageTable:
    return PageTable(name, name, "", ["a"], [True], [])


@pytest.mark.parametrize(("need", "shown"), [("full", True), ("empty", False), ("absent", False), ("number", True)])
def test_a_section_needs_its_parts(need, shown):
    content = SimpleNamespace(full=FULL, empty=EMPTY, number=0.0)
    section = Section("A", {"a": (lambda _: table("a"), need)})
    assert [one.id for one in draw_sections({"a": section}, content)] == ["a"] * shown


def test_order_and_gaps():
    sections = {
        "b": Section("B", {"none": (lambda _: None, ""), "b": (lambda _: table("b"), "")}),
        "none": Section("Nothing", {"nothing": (lambda _: None, "")}),
        "a": Section("A", {"a": (lambda _: table("a"), "")}),
    }
    assert [(one.id, one.title, [i.id for i in one.items]) for one in draw_sections(sections, None)] == [
        ("b", "B", ["b"]),
        ("a", "A", ["a"]),
    ]
