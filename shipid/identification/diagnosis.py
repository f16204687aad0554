"""What is wrong where a vessel and a log disagree: every cause is a nuisance of one fit, and all of them are compared.

**The fit.** Equations of motion and of kinematics are multiplied by a bump phi(t) that moves along the runs, and
integrated by parts (the weak form of `shipid.identification.inverse`): nothing is differentiated, nothing diverges.
Each bump gives six residuals, measured change less predicted change: of u, v, r by the physics, of heading by the yaw
rate, of position along and across by heading and velocities. A cause is a change of the log (commands, sensors), of
the water or of the numbers of the vessel; it is fitted alone by Gauss-Newton from the same start.

**Keys.** `command C zero`, `scale`, `sign`, `delay`, of a shaft also `scale astern` and `unsigned`;
`exchange A B` (two thrusters); `sensor S bias` (u, v, r, psi), `scale` (u, v, r, velocity), `sign` (v, r, psi), `delay`
(u, v, r, psi, velocity, position); `heading is course`; `lever arm position`, `lever arm position and velocity`,
`lever arm velocity`; `current`, `current by run`, `velocity through water`; `wind scale`, `wind direction`;
`coefficient damping`, `mass`, `thrust`, `rudder`; besides `none` and `cannot tell`.

**Classes of equals**, which no or hardly any log tells apart (each with the run that would):

- zero of an angle that steers, and an asymmetry of hull or screw;
- scale of a command, and the coefficient of its thrust (`thrust`, `rudder`), and of a shaft the damping ahead;
- delay of a command, a slower actuator, and all sensors early;
- bias of psi, positions in turned axes, and on one course a current, velocity through water or bias of v;
- bias and scale of u at one speed, velocity through water on one course, and scale of the velocity;
- lever arm of the position ahead, and its delay, at one speed and without turns;
- exchanged thrusters, and the sign of each where they are used against each other;
- coefficient of mass, and of thrust and damping together; coefficients of thrust and damping at steady speed.

**Judgement.** The misfit of a cause is the sum over the six equations of n ln(mean square + floor^2), n being bumps
that do not overlap: it is free of scale, and an equation in which the vessel is poor weighs little. The floor is the
white noise that the log itself shows, as it passes the bump, and `EXACT` of the size of the terms. A cause is
estimated without a part of the runs (or of the time, where there is one run) and its misfit is taken on that part.

- `none`: no cause lowers the misfit by more than `SURE` standard errors over blocks of time, or the one that lowers it
  most lowers the error of the predicted path by less than a share `WORTH`, or is smaller than what a log has anyhow (a
  command that is a row late).
- The cause of least misfit is named where it is better than each other one, its equals apart, by `APART` standard
  errors; those of its class that are not are `equals`. Else the answer is `cannot tell`, and `equals` are the causes
  that remain.
- The next cause is looked for in the same way beside the first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from shipid.data.dataset import Dataset
from shipid.vessel.load import Vessel

NONE, UNCLEAR = "none", "cannot tell"


@dataclass(frozen=True)
class Diagnosis:
    """What is wrong with a vessel and its log.

    cause : key, `none` or `cannot tell`. equals : keys that the log does not tell from it.
    size : of the cause in SI units, an empty tuple where it has none (a sign). interval : 95 %, (low, high) of each.
    repair : lines for the mapping of the log, the vessel or the settings of an identification.
    sentence : all of it in words.
    next : the same of a second cause beside the first, if there is one.
    """

    cause: str
    equals: tuple[str, ...] = ()
    size: tuple[float, ...] = ()
    interval: tuple[tuple[float, float], ...] = ()
    repair: str = ""
    sentence: str = ""
    next: Diagnosis | None = None


def diagnose(vessel: Vessel, dataset: Dataset, runs: Sequence[str] | None = None) -> Diagnosis:
    """Find what is wrong with a vessel and a log of it; runs : names, default: all."""
    raise NotImplementedError
