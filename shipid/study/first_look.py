"""A vessel against its log, before any study: whether it predicts better than constant u, v, r.

The vessel starts from recorded instants with the recorded commands. Its mean position error over the horizon stands
beside that of constant u, v, r, and how far it turns and how fast it gets beside the motion of the ship.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from shipid.data.dataset import Dataset
from shipid.data.windows import PathSource, cut_windows
from shipid.hybrid.physics import Physics, check_columns
from shipid.metrics import position_error
from shipid.study.prepare import constant_motion, window_memory
from shipid.vessel.load import Vessel

LEAST_TURN_OF_WINDOW = np.radians(5.0)  # the share of a smaller turn is mostly noise of the heading
LEAST_ERROR = 1e-3  # m: no log has positions so near to the truth


@dataclass(frozen=True)
class Look:
    """How a vessel and a log agree.

    ahead : [s]. vessel_error, constant_error : mean position error [m] over it, infinite where a path diverges.
    turning, speed : how far the vessel turns, and how fast it is in the end, as shares of what the ship did (medians
        over windows); NaN where the ship hardly turns or moves.
    """

    vessel: Vessel
    ahead: float
    vessel_error: float
    constant_error: float
    turning: float
    speed: float

    @property
    def wrong(self) -> bool:
        """Whether the vessel should not be used as it is: no better than constant u, v, r, or of the other sign."""
        return self.vessel_error >= max(self.constant_error, LEAST_ERROR) or self.turning < 0

    @property
    def sentence(self) -> str:
        """One line: both errors, and how turning and speed differ."""
        name, errors = self.vessel.name, f"mean error over {self.ahead:g} s {self.vessel_error:.3g} m"
        errors += f", of constant u, v, r {self.constant_error:.3g} m"
        shares = ((self.speed, "its speed is then {:.2g} times that of the ship"),
                  (self.turning, "it turns {:.2g} times as far"))  # fmt: skip
        seen = "; ".join([errors, *(words.format(share) for share, words in shares if np.isfinite(share))])
        if self.turning < 0:
            return f"{name} turns the other way than the ship of the log: check the signs of angles and yaw; {seen}"
        how = "is no better than" if self.wrong else "is better than"
        return f"{name} {how} constant u, v, r: {seen}"


def first_look(
    vessel: Vessel, dataset: Dataset, runs: Iterable[str], *, ahead: float, step: float, path: PathSource = "position"
) -> Look:
    """Compare a vessel, stepped by RK4, with some runs of a log.

    Parameters
    ----------
    runs : names of the runs to look at. ahead, step : of the predictions [s]. path : as in `cut_windows`.

    Raises
    ------
    DataError : no run is as long as the horizon, or a command of the vessel is missing.
    """
    check_columns(vessel, dataset.frame.columns, str(vessel.file))
    part, horizon = dataset.select(runs), max(round(ahead / step), 1)
    windows = cut_windows(part, horizon=horizon, step=step, interval=max(step, horizon * step / 4), path=path)
    instants = windows.instants(known=True, hidden=window_memory(vessel, part, windows))
    physics = Physics(vessel, horizon, step, "rk4")
    error = np.nan_to_num(position_error(physics.paths(instants), windows.future), nan=np.inf)
    constant = position_error(constant_motion(windows), windows.future)
    predicted, true, now = physics.states(instants), windows.states, windows.columns["psi"]
    turned, speed = true["psi"][-1] - now, np.hypot(true["u"][-1], true["v"][-1])
    return Look(
        vessel, horizon * step, float(error.mean()), float(constant.mean()),
        _median_share(predicted["psi"][-1] - now, turned, LEAST_TURN_OF_WINDOW),
        _median_share(np.hypot(predicted["u"][-1], predicted["v"][-1]), speed, 0.0),
    )  # fmt: skip


def _median_share(predicted: NDArray[np.float64], true: NDArray[np.float64], least: float) -> float:
    """Median of predicted over true (N,), where the truth is larger than `least`; NaN where it nowhere is."""
    much = (np.abs(true) > least) & np.isfinite(predicted)
    return float(np.median(predicted[much] / true[much])) if much.any() else np.nan
