"""Execute notebooks and store them with their results: `python docs/notebooks/execute.py [NAME.ipynb ...]`.

A figure is stored as SVG, so that every reader of notebooks shows it without a network.
Needs the extra `docs` and Chromium.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
from pathlib import Path

import nbformat
import plotly.io
from nbclient import NotebookClient

HERE = Path(__file__).parent
PLOTLY = "application/vnd.plotly.v1+json"


def executed(file: Path, folder: Path) -> nbformat.NotebookNode:
    """Return the notebook with the results of all its cells, executed in a folder; figures are data of plotly."""
    notebook = nbformat.read(file, as_version=4)
    os.environ["PLOTLY_RENDERER"] = "plotly_mimetype"
    os.environ["OMP_NUM_THREADS"] = "1"
    os.environ["PYTHONWARNINGS"] = "ignore:IProgress not found"  # of a progress bar that needs a widget
    NotebookClient(notebook, timeout=600, resources={"metadata": {"path": str(folder)}}).execute()
    return notebook


def store(file: Path) -> None:
    """Execute a notebook and write it with its figures as SVG, without times and versions."""
    sys.path.insert(0, str(HERE.parent))
    from pictures import svg

    with tempfile.TemporaryDirectory() as folder:
        notebook = executed(file, Path(folder))
    for cell in notebook.cells:
        cell.metadata.pop("execution", None)
        for output in cell.get("outputs", [])[:]:
            if output.get("name") == "stderr":  # bars of progress
                cell.outputs.remove(output)
            data = output.get("data", {})
            if PLOTLY in data:
                figure = plotly.io.from_json(json.dumps(data[PLOTLY]), skip_invalid=True)
                output["data"] = {"image/svg+xml": svg(figure)}
    notebook.metadata = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    nbformat.write(notebook, file)


if __name__ == "__main__":
    for file in map(Path, sys.argv[1:] or sorted(map(str, HERE.glob("*.ipynb")))):
        store(file)
        print(f"{file.name} {file.stat().st_size / 1000:.0f} kB")
