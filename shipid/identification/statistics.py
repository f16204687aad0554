"""How far estimates can be trusted: covariances, intervals, and which parameters the data identify.

A weighted least-squares fit with residuals e (m,) and sensitivities J (m, n) has A = J^T J + Lambda, Lambda the
precision of the priors, and cov = A^-1 (B + Lambda) A^-1. Three forms of B, of what they assume:

    fisher    B = sum over signals of s^2 J_s^T J_s      errors independent from sample to sample; s^2 is the level of
              each signal as the residuals show it, not as declared. To be trusted where residuals are white.
    sandwich  B = sum over clusters of (J_g^T A_g e_g)(...)^T     anything within a cluster, independent clusters.
              A cluster is a run: process noise, model error and colour within it are allowed. A_g = (I - H_gg)^(-1/2)
              takes the bias out that fitting puts in (CR2), t has Satterthwaite's degrees of freedom. To be trusted
              from 4 degrees of freedom on (Tipton).
    blocks    the same on stretches of a run, each much longer than residuals remember. For few runs; a current or a
              bias that lasts a run stays unseen.

None of them sees a bias. Where every prediction has a start of its own to be found, coloured residuals pull the factors
(incidental parameters: Neyman, Scott, Econometrica 16 (1948) 1), the more the shorter the horizon is against what the
residuals remember: compare with a fit over a longer one.

Sources: Liang, Zeger, Biometrika 73 (1986) 13; Bell, McCaffrey, Survey Methodology 28 (2002) 169; Pustejovsky, Tipton,
Journal of Business & Economic Statistics 36 (2018) 672 (also that nuisances may be projected out first); Tipton,
Psychological Methods 20 (2015) 375 (4 degrees of freedom); Carlstein, Annals of Statistics 14 (1986) 1171 (blocks);
Ljung, Box, Biometrika 65 (1978) 297.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from shipid.errors import ShipidError
from shipid.identification.collinearity import UNSEEN, Collinearity, collinearity, listed, short

if TYPE_CHECKING:
    from shipid.identification.solve import Solution

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Kind = Literal["fisher", "sandwich", "blocks"]
KINDS: tuple[Kind, ...] = get_args(Kind)
"""In order of preference: the first that is to be trusted is reported, else the last that says anything."""

LEVEL = 0.95
WIDEST = 1.0  # half-width of the 95 % interval of a factor, in base values, from which on it is not identified
LEAST_FREEDOM = 4.0  # degrees of freedom under which t misleads (Tipton 2015)
WHITE = 0.05  # probability under which whiteness is rejected
LITTLE = 1.1  # integrated correlation time, in samples, that makes no difference: 5 % of a standard error
MOST_LAGS, LEAST_ROWS = 10, 5  # lags that whiteness looks at; rows of a run that tell any
BLOCK = 10.0  # length of a block in integrated correlation times
KEPT = 1e-9  # of I - H: directions that a cluster alone decides have no residual left


@dataclass(frozen=True)
class LinearFit:
    """What a fit leaves behind, as plain arrays; m residuals, n parameters.

    Parameters
    ----------
    paths, factors : names and estimates (n,), factors on the base values (dimensionless).
    residuals : (m,) predicted less measured over the declared standard deviation; of each run in the order of time.
    jacobian : (m, n) d residual / d factor, per-run nuisances projected out.
    clusters, signals : run number and signal of each residual.
    prior_widths : (n,) standard deviation of each factor's prior; infinite without one.
    spent : (m,) share of each residual that the nuisances have taken (its leverage); 0 without nuisances.
    at_bound : (n,) estimates that stand at a bound, and so have no interval. held : (n,) factors that were not free,
        which have none either. dropped : paths of those that the data did not support.
    runs : name of each run number; empty: they go by number.
    """

    paths: tuple[str, ...]
    factors: Array
    residuals: Array
    jacobian: Array
    clusters: Index
    signals: tuple[str, ...]
    prior_widths: Array | None = None
    spent: Array | None = None
    at_bound: NDArray[np.bool_] | None = None
    held: NDArray[np.bool_] | None = None
    dropped: tuple[str, ...] = ()
    runs: tuple[str, ...] = ()

    @classmethod
    def of(cls, solution: Solution) -> LinearFit:
        """What a solution of `identify` holds of it."""
        return cls(**{name: getattr(solution, name) for name in cls.__dataclass_fields__})

    def __post_init__(self) -> None:
        m, n = self.jacobian.shape
        if not (len(self.residuals) == len(self.clusters) == len(self.signals) == m and len(self.factors) == n):
            raise ShipidError(f"residuals, clusters and signals must be ({m},) and factors ({n},), as the jacobian is")
        if not (np.isfinite(self.residuals).all() and np.isfinite(self.jacobian).all()):
            raise ShipidError("residuals and sensitivities must be finite: the prediction diverges at the estimate")
        if m <= n:
            raise ShipidError(f"{m} residuals cannot say how well {n} parameters are known: take more data")


@dataclass(frozen=True)
class Whiteness:
    """Colour of the residuals of one signal.

    probability : of residuals this correlated if they were white (Ljung-Box, summed over runs).
    memory : integrated correlation time in samples, 1 for white. samples, effective : how many, and worth how many.
    level : standard deviation over the declared one. freedom : degrees of freedom of that level.
    """

    probability: float
    memory: float
    samples: int
    level: float
    freedom: float

    @property
    def effective(self) -> float:
        """Number of independent samples worth as much."""
        return self.samples / max(self.memory, 1.0)

    @property
    def white(self) -> bool:
        """Whether colour can be neglected."""
        return self.probability >= WHITE or self.memory <= LITTLE


@dataclass(frozen=True)
class Covariance:
    """One form of covariance: (n, n) of the factors, degrees of freedom (n,), whether to trust it and why.

    influences : (clusters, n) what each cluster does to the estimate, where the form is made of them.
    """

    kind: Kind
    matrix: Array
    freedom: Array
    trusted: bool
    reason: str
    influences: Array | None = None

    @property
    def errors(self) -> Array:
        """Standard errors (n,)."""
        return np.sqrt(np.diag(self.matrix))

    @property
    def half_widths(self) -> Array:
        """Half-widths (n,) of the 95 % intervals."""
        return np.asarray(self.errors * stats.t.ppf(0.5 + LEVEL / 2, self.freedom))


@dataclass(frozen=True)
class Statistics:
    """What is known of the factors.

    chosen : the form of covariance to report. errors, low, high : (n,); infinite where the data say nothing.
    alone : (n,) half-widths without the priors. identifiable : (n,) whether that is at most `WIDEST`.
    sentences : why, for each parameter. correlations : (n, n).
    """

    fit: LinearFit
    covariances: Mapping[Kind, Covariance]
    chosen: Kind
    errors: Array
    low: Array
    high: Array
    alone: Array
    correlations: Array
    identifiable: NDArray[np.bool_]
    sentences: tuple[str, ...]
    collinearity: Collinearity
    whiteness: Mapping[str, Whiteness]

    @property
    def information(self) -> Array:
        """Fisher information (n, n) of the factors with the levels that the residuals show, priors not counted."""
        levels = np.array([self.whiteness[name].level for name in self.fit.signals])
        scaled = self.fit.jacobian / levels[:, None]
        return np.asarray(scaled.T @ scaled)


def statistics(fit: LinearFit, widest: float = WIDEST) -> Statistics:
    """Judge a fit: covariances, 95 % intervals, identifiability.

    A factor is identified if the data alone, without its prior, put its 95 % interval within +-`widest` base values: by
    default, if they can tell the estimate from one that differs by the base value. Collinearity explains an interval
    that is wider, it does not judge: what is collinear may still be found. All is linear at the estimate; where an
    interval is wide the profile (`shipid.identification.profile`) says whether it ends at all.
    """
    free = _free_places(fit)
    if not len(free):
        return _nothing(fit)
    inner = _free(fit, free)
    basis = _Basis.of(inner)
    colours = whiteness(inner, basis.leverage)
    found = _covariances(inner, basis, colours)
    chosen: Kind = next((kind for kind in KINDS if kind in found and found[kind].trusted), _last(found))
    best = found[chosen]
    half = np.where(basis.unseen & ~basis.held, np.inf, best.half_widths)
    errors = np.where(basis.unseen & ~basis.held, np.inf, best.errors)
    alone = _alone(inner, best, found["fisher"], colours)
    seen = collinearity(inner.jacobian, inner.paths)
    n = len(fit.paths)
    full = {name: _spread(values, free, n) for name, values in {"errors": errors, "half": half, "alone": alone}.items()}
    identifiable = np.zeros(n, dtype=bool)
    identifiable[free] = alone <= widest
    correlations = np.eye(n)
    scale = np.where(best.errors > 0, best.errors, 1.0)
    correlations[np.ix_(free, free)] = best.matrix / np.outer(scale, scale)
    np.fill_diagonal(correlations, 1.0)
    return Statistics(
        fit=fit,
        covariances=found,
        chosen=chosen,
        errors=full["errors"],
        low=fit.factors - full["half"],
        high=fit.factors + full["half"],
        alone=full["alone"],
        correlations=correlations,
        identifiable=identifiable,
        sentences=_sentences(fit, full["half"], full["alone"], identifiable, seen),
        collinearity=seen,
        whiteness=colours,
    )


def _last(found: Mapping[Kind, Covariance]) -> Kind:
    """What is reported where nothing is to be trusted: a single block says nothing, its scores sum to 0."""
    blocks = found.get("blocks")
    return "blocks" if blocks is None or blocks.influences is None or len(blocks.influences) > 1 else "fisher"


def _nothing(fit: LinearFit) -> Statistics:
    """What is known where no factor is free."""
    n, jacobian = len(fit.paths), fit.jacobian[:, :0]
    none, wide, fixed = np.zeros(0), np.full(n, np.inf), np.zeros(n, dtype=bool)
    seen = collinearity(jacobian, ())
    covariance = Covariance("fisher", np.zeros((0, 0)), none, False, "no factor is free", none.reshape(0, 0))
    sentences = _sentences(fit, wide, wide, fixed, seen)
    low, high, levels = fit.factors - wide, fit.factors + wide, whiteness(fit)
    return Statistics(
        fit, {"fisher": covariance}, "fisher", wide, low, high, wide, np.eye(n), fixed, sentences, seen, levels
    )


def _free_places(fit: LinearFit) -> Index:
    """Columns of the factors that are neither held nor at a bound."""
    fixed = np.zeros(len(fit.paths), dtype=bool)
    for own in (fit.at_bound, fit.held):
        fixed |= False if own is None else own
    return np.flatnonzero(~fixed)


def _free(fit: LinearFit, free: Index) -> LinearFit:
    """The fit of these columns, all others held."""
    widths = _widths(fit)[free]
    paths = tuple(fit.paths[j] for j in free)
    return LinearFit(
        paths, fit.factors[free], fit.residuals, fit.jacobian[:, free], fit.clusters, fit.signals, widths, fit.spent,
        runs=fit.runs,
    )  # fmt: skip


def _widths(fit: LinearFit) -> Array:
    return np.full(len(fit.paths), np.inf) if fit.prior_widths is None else np.asarray(fit.prior_widths, dtype=float)


def _spread(values: Array, free: Index, count: int) -> Array:
    """Values of the free parameters among all; infinite for the others."""
    full = np.full(count, np.inf)
    full[free] = values
    return full


@dataclass(frozen=True)
class _Basis:
    """A = J^T J + Lambda, inverted with columns scaled to unit length.

    inverse : (n, n), 0 along directions that neither data nor priors see. prior : (n,) precisions.
    leverage : (m,) of J A^-1 J^T. unseen : (n,) parameters that such a direction moves; held : those with a prior.
    """

    inverse: Array
    prior: Array
    leverage: Array
    unseen: NDArray[np.bool_]
    held: NDArray[np.bool_]

    @classmethod
    def of(cls, fit: LinearFit) -> _Basis:
        prior = 1 / _widths(fit) ** 2
        inverse, unseen = inverted(fit.jacobian.T @ fit.jacobian + np.diag(prior))
        leverage = np.einsum("mi,ij,mj->m", fit.jacobian, inverse, fit.jacobian)
        return cls(inverse, prior, leverage, unseen, prior > 0)


def inverted(information: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Inverse of an information matrix (n, n), 0 along unseen directions; and which parameters those move, (n,)."""
    scale = np.sqrt(np.diag(information))
    scale = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    silent = values <= UNSEEN * max(float(values[-1]), UNSEEN)
    kept = vectors[:, ~silent]
    inverse = (kept / values[~silent]) @ kept.T / np.outer(scale, scale)
    return inverse, np.asarray((np.abs(vectors[:, silent]) > np.sqrt(UNSEEN)).any(axis=1))


def whiteness(fit: LinearFit, leverage: Array | None = None) -> dict[str, Whiteness]:
    """Colour and level of the residuals of each signal; `leverage` (m,) is what the parameters took of them."""
    taken = (np.zeros(len(fit.residuals)) if leverage is None else leverage) + (0.0 if fit.spent is None else fit.spent)
    labels = np.array(fit.signals)
    found = {}
    for name in dict.fromkeys(fit.signals):
        own = labels == name
        freedom = max(float(own.sum() - taken[own].sum()), 1.0)
        level = float(np.sqrt((fit.residuals[own] ** 2).sum() / freedom))
        runs = [fit.residuals[own & (fit.clusters == run)] for run in np.unique(fit.clusters[own])]
        probability, memory = _colour(runs)
        found[name] = Whiteness(probability, memory, int(own.sum()), level, freedom)
    return found


def _colour(runs: Sequence[Array]) -> tuple[float, float]:
    """Probability (Ljung-Box, the statistics of independent runs added) and integrated correlation time (samples).

    The time is 1 + 2 sum rho_k over the pooled correlations up to the first pair that is no longer positive (Geyer,
    Statistical Science 7 (1992) 473).
    """
    statistic, freedom = 0.0, 0
    for run in runs:
        size, lagged = len(run), _lagged(run)
        if size < LEAST_ROWS or lagged[0] == 0:
            continue
        lags = np.arange(1, min(MOST_LAGS, size // 5) + 1)
        statistic += size * (size + 2) * float(((lagged[lags] / float(run @ run)) ** 2 / (size - lags)).sum())
        freedom += len(lags)
    if freedom == 0:
        return 1.0, 1.0
    rho = autocorrelation(runs)
    sums = rho[1:-1:2] + rho[2::2]
    until = int(np.argmax(sums <= 0)) if (sums <= 0).any() else len(sums)
    return float(stats.chi2.sf(statistic, freedom)), float(max(1 + 2 * sums[:until].sum(), 1.0))


def autocorrelation(runs: Sequence[Array]) -> Array:
    """Correlation of residuals with those so many samples later, (longest run,), pooled over runs; 1 at lag 0."""
    longest = max(len(run) for run in runs)
    products, pairs = np.zeros(longest), np.zeros(longest)
    for run in runs:
        size, lagged = len(run), _lagged(run)
        if size >= LEAST_ROWS and lagged[0] > 0:
            products[:size] += lagged
            pairs[:size] += size - np.arange(size)
    if not pairs[0]:
        return np.ones(1)
    return np.asarray(products / np.maximum(pairs, 1) / (products[0] / pairs[0]))


def _lagged(run: Array) -> Array:
    """Sums (N,) of the products of values so many samples apart."""
    size = len(run)
    return np.asarray(np.fft.irfft(np.abs(np.fft.rfft(run, 2 * size)) ** 2)[:size]) if run.any() else np.zeros(size)


def _covariances(fit: LinearFit, basis: _Basis, colours: Mapping[str, Whiteness]) -> dict[Kind, Covariance]:
    """Fisher and sandwich, and blocks where neither is to be trusted."""
    found: dict[Kind, Covariance] = {"fisher": fisher(fit, basis, colours)}
    found["sandwich"] = sandwich(fit, basis, fit.clusters, "sandwich", "runs")
    if not any(own.trusted for own in found.values()):
        length = BLOCK * max(colour.memory for colour in colours.values())
        found["blocks"] = sandwich(fit, basis, blocks(fit, length), "blocks", f"stretches of {length:.0f} samples")
    return found


def fisher(fit: LinearFit, basis: _Basis, colours: Mapping[str, Whiteness]) -> Covariance:
    """Covariance for errors that are independent from sample to sample, each signal with its own level."""
    labels = np.array(fit.signals)
    parts, freedoms = [], []
    for name, colour in colours.items():
        own = fit.jacobian[labels == name] @ basis.inverse
        parts.append(colour.level**2 * (own.T @ own))
        freedoms.append(colour.freedom)
    matrix = sum(parts) + (basis.inverse * basis.prior) @ basis.inverse
    total = np.diag(matrix)
    squares = sum(np.diag(part) ** 2 / freedom for part, freedom in zip(parts, freedoms, strict=True))
    coloured = [name for name, colour in colours.items() if not colour.white]
    reason = "residuals are white" if not coloured else f"residuals of {', '.join(coloured)} remember earlier ones"
    return Covariance("fisher", matrix, _freedom(total, np.asarray(squares)), not coloured, reason)


def declared_error(fit: LinearFit, path: str) -> float:
    """Standard error of one factor if residuals err independently, by the declared standard deviations."""
    inner = _free(fit, _free_places(fit))
    inverse = _Basis.of(inner).inverse
    j = inner.paths.index(path)
    return float(np.sqrt(inverse[j, j]))


def _freedom(total: Array, squares: Array) -> Array:
    """Satterthwaite: total^2 / sum(part^2 / its freedom); infinite where a variance is known exactly."""
    return np.asarray(np.where(squares > 0, total**2 / np.where(squares > 0, squares, 1.0), 1e9))


def sandwich(fit: LinearFit, basis: _Basis, clusters: Index, kind: Kind, what: str) -> Covariance:
    """Cluster-robust covariance (CR2) with Satterthwaite's degrees of freedom under independent errors."""
    n = len(fit.paths)
    root = _root(basis.inverse)
    scores, own, shared = [], [], []
    for number in np.unique(clusters):
        rows = clusters == number
        jacobian = fit.jacobian[rows]
        spread = jacobian @ root  # H_gg = spread spread^T
        left, values, _ = np.linalg.svd(spread, full_matrices=False)
        rest = 1 - values**2
        grown = np.where(rest > KEPT, 1 / np.sqrt(np.maximum(rest, KEPT)), 0.0) - 1
        adjusted = jacobian + left @ (grown[:, None] * (left.T @ jacobian))  # A_g J_g
        scores.append(adjusted.T @ fit.residuals[rows])
        influence = adjusted @ basis.inverse  # (m_g, n)
        own.append((influence**2).sum(axis=0))
        shared.append(spread.T @ influence)  # (n, n): of (I - H)_gh = delta_gh - spread_g spread_h^T
    influences = -np.array(scores) @ basis.inverse
    spread_of_data = influences.T @ influences
    matrix = spread_of_data + (basis.inverse * basis.prior) @ basis.inverse
    free = np.array([_satterthwaite(np.array(own)[:, j], np.array(shared)[:, :, j]) for j in range(n)])
    freedom = np.maximum(_freedom(np.diag(matrix), np.diag(spread_of_data) ** 2 / free), 1.0)
    typical = float(np.median(freedom))
    trusted = bool(typical >= LEAST_FREEDOM)
    reason = f"{len(own)} {what}, worth {typical:.1f} degrees of freedom"
    if not trusted:
        reason += f"; under {LEAST_FREEDOM:g} the intervals mislead"
    return Covariance(kind, matrix, freedom, trusted, reason, influences)


def _root(matrix: Array) -> Array:
    """R with R R^T = matrix, of a positive semidefinite matrix whose scales differ."""
    scale = np.sqrt(np.diag(matrix))
    scale = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def _satterthwaite(own: Array, shared: Array) -> float:
    """(tr B)^2 / tr(B^2) of B = diag(own) - shared shared^T; own (clusters,), shared (clusters, n)."""
    taken = (shared**2).sum(axis=1)
    squares = float(own @ own - 2 * own @ taken + ((shared.T @ shared) ** 2).sum())
    return float((own.sum() - taken.sum()) ** 2 / squares) if squares > 0 else 1.0


def blocks(fit: LinearFit, length: float) -> Index:
    """Clusters (m,) of about `length` samples each: runs cut into equal stretches of the same times for all signals."""
    labels, result, count = np.array(fit.signals), np.zeros(len(fit.residuals), dtype=np.int64), 0
    for run in np.unique(fit.clusters):
        most = 1
        for name in dict.fromkeys(fit.signals):
            rows = np.flatnonzero((fit.clusters == run) & (labels == name))
            pieces = max(int(len(rows) / length), 1)
            result[rows] = count + np.arange(len(rows)) * pieces // max(len(rows), 1)
            most = max(most, pieces)
        count += most
    return result


def _alone(fit: LinearFit, best: Covariance, plain: Covariance, colours: Mapping[str, Whiteness]) -> Array:
    """Half-widths (n,) from the data alone: Fisher's without priors, widened as the chosen form widens it."""
    levels = np.array([colours[name].level for name in fit.signals])
    inverse, unseen = inverted(fit.jacobian.T @ fit.jacobian)
    own = (levels[:, None] * fit.jacobian) @ inverse
    widened = np.where(plain.errors > 0, best.errors / np.where(plain.errors > 0, plain.errors, 1.0), 1.0)
    quantile = stats.t.ppf(0.5 + LEVEL / 2, best.freedom)
    return np.asarray(np.where(unseen, np.inf, np.sqrt((own**2).sum(axis=0)) * widened * quantile))


def _sentences(
    fit: LinearFit, half: Array, alone: Array, identifiable: NDArray[np.bool_], seen: Collinearity
) -> tuple[str, ...]:
    """One sentence for each parameter: how well it is known or why not."""
    free, told = _free_places(fit), list[str]()
    for j, (path, name) in enumerate(zip(fit.paths, short(fit.paths), strict=True)):
        together = next((own for own in seen.combinations if path in own.paths), None)
        known = f"{name} is known to +-{100 * half[j]:.2g} % of its base value"
        if path in fit.dropped:
            told.append(f"{name} was dropped, to {fit.factors[j]:.4g}: the data do not support a change")
        elif fit.held is not None and fit.held[j]:
            told.append(f"{name} was held at {fit.factors[j]:.4g}: no interval")
        elif j not in free:
            told.append(f"{name} stands at its bound, {fit.factors[j]:.4g}: no interval")
        elif identifiable[j] and together is None:
            told.append(known)
        elif identifiable[j]:
            assert together is not None
            others = listed([own for own in together.names if own != name])
            index = f"collinearity index {together.gamma:.0f}"
            told.append(f"{known}, if the model is right: {others} do nearly the same ({index})")
        elif together is not None:
            told.append(f"{name} is not identified: {together.sentence()}")
        elif np.isfinite(alone[j]):
            told.append(f"{name} is not identified: +-{100 * alone[j]:.2g} % of its base value, hardly excited")
        else:
            told.append(f"{name} is not identified: no effect of its own on what these data hold")
    return tuple(told)
