"""The pictures of the documentation: plotly figures as SVG, drawn by Chromium with the plotly that the reports use.

`python docs/pictures.py RUN` draws those of the readme and of the gallery. RUN is the folder of the study `quick`.
The pictures are stored beside the pages, so building the site needs neither this script nor a browser.
"""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

import plotly.graph_objects as go

import shipid
from shipid.errors import ShipidError

IMAGES = Path(__file__).parent / "images"
PLOTLY = Path(shipid.__file__).parent / "report" / "vendor" / "plotly-cartesian.min.js"
PAGE = """<!doctype html><meta charset="utf-8"><script>{plotly}</script><div id="figure"></div><script>
const given = {figure};
Plotly.newPlot("figure", given.data, given.layout)
  .then((figure) => Plotly.toImage(figure, {{format: "svg", width: {width}, height: {height}}}))
  .then((url) => {{ document.body.innerHTML = "<pre>" + url.slice(url.indexOf(",") + 1) + "</pre>"; }});
</script>"""


def browser() -> str | None:
    """Path of Chromium or Chrome; None without one."""
    names = ("chromium", "chromium-browser", "google-chrome", "chrome")
    return next(filter(None, map(shutil.which, names)), None)


def svg(figure: go.Figure) -> str:
    """Draw a figure as SVG; ShipidError where there is no browser or it does not answer."""
    program = browser()
    if program is None:
        raise ShipidError("pictures are drawn by Chromium or Chrome: install one and put it on PATH")
    width, height = figure.layout.width or 760, figure.layout.height or 460
    given = figure.to_json().replace("</", "<\\/")
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "figure.html"
        script = PLOTLY.read_text(encoding="utf-8")
        page.write_text(PAGE.format(plotly=script, figure=given, width=width, height=height), encoding="utf-8")
        options = ["--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=20000"]
        command = [program, *options, f"--user-data-dir={folder}/profile", "--dump-dom", page.as_uri()]
        answer = subprocess.run(command, capture_output=True, text=True, timeout=120, check=False).stdout
    match = re.search(r"<pre>([^<]*)</pre>", answer)
    if match is None:
        raise ShipidError("the browser did not draw the figure")
    return light(unquote(match[1])) + "\n"


def light(picture: str) -> str:
    """An SVG with coordinates to a hundredth of a pixel, which is enough; numbers of its text stay as they are."""
    return re.sub(r"<[^>]*>", lambda tag: re.sub(r"(\d+\.\d\d)\d+", r"\1", tag[0]), picture)


def pictures(run: Path) -> Iterator[tuple[str, go.Figure]]:
    """Name and figure of every picture of the readme and the gallery."""
    results = shipid.figures.content_of(shipid.read_results(run))
    question = shipid.figures.prediction(results, N_D=10)
    words = "The true path of one turn, and what each model says. Each had 10 runs of data."
    title = f"Where will the ship be in 30 s?<br><sup>{words}</sup>"
    yield "question", question.update_layout(title_text=title)
    words = "Numbers: H [m], the mean error over 30 s. 0 runs: physics alone."
    title = f"How good the physics, and how many runs?<br><sup>{words}</sup>"
    yield "answer", shipid.figures.error_map(results).update_layout(title_text=title, width=560)
    yield "gain", shipid.figures.gain(results)
    yield "error-over-horizon", shipid.figures.error_over_horizon(results)
    yield "factors", shipid.figures.factors(results)
    yield "tracks", shipid.figures.tracks(results)
    yield "coverage", shipid.figures.coverage(results)
    mariner, kvlcc2 = shipid.load_vessel("mariner"), shipid.load_vessel("kvlcc2-l7")
    yield "turning-circle", shipid.figures.track(shipid.measure_standard(mariner, "turning", [35]))
    yield "zigzag", shipid.figures.histories(shipid.measure_standard(kvlcc2, "zigzag", [20, 20]))
    yield "spiral", shipid.figures.spiral(shipid.measure_standard(mariner, "spiral"))


if __name__ == "__main__":
    IMAGES.mkdir(exist_ok=True)
    for name, figure in pictures(Path(sys.argv[1])):
        text = svg(figure)
        (IMAGES / f"{name}.svg").write_text(text, encoding="utf-8")
        print(f"{name}.svg {len(text) / 1000:.0f} kB")
