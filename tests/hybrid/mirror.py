"""The port-starboard mirror of a recorded dataset."""

from shipid.data.dataset import Dataset

SIDES = {"port": "starboard", "starboard": "port"}
ODD = (
    "east",
    "psi",
    "phi",
    "v",
    "r",
    "p",
    "beta_w",
    "alpha",
    "delta",
)  # change sign; written apart from the table of signals


def mirrored(dataset: Dataset) -> Dataset:
    """The same runs as a mirror shows them: east is west, port is starboard."""
    columns = {}
    for name in map(str, dataset.frame.columns):
        component, dot, signal = name.rpartition(".")
        image = f"{SIDES.get(component, component)}{dot}{signal}"
        columns[image] = -dataset.frame[name] if signal in ODD else dataset.frame[name]
    frame = dataset.frame.assign(**columns)
    return Dataset(frame, dataset.metadata)
