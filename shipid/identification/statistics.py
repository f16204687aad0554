"""Uncertainty of the estimates: covariances, confidence intervals, and identifiability.

A weighted least-squares fit with residuals e (m,) and sensitivities J (m, n) has A = J^T J + Lambda, Lambda the
precision of the priors, and cov = A^-1 (B + Lambda) A^-1. Three forms of B:

fisher    B = sum over signals of s^2 J_s^T R_s J_s    s^2 is the level of each signal as the residuals show it; R_s,
          the correlation in time of a first-order process, is 1 where residuals are white: trusted there.
sandwich  B = sum over clusters of (J_g^T A_g e_g)(...)^T     clusters are runs, independent of each other.
          A_g = (I - H_gg)^(-1) gives the estimates without that run (CR3, the jackknife). One number scales B so that
          it is right in the median direction where errors are independent; t has Satterthwaite's degrees of freedom
          (of CR2). In a direction that one run alone decides errors count as in the others on average. Trusted from
          4 degrees of freedom on (Tipton), in the median of the factors that data rather than priors decide.
blocks    the sandwich with clusters that are stretches of a run, longer than the correlation time of the residuals.
          It does not account for a current or a bias that lasts a whole run.

No form accounts for a bias. With free initial states coloured residuals bias the factors (Neyman, Scott, Econometrica
16 (1948) 1), the more the shorter the horizon is against their correlation time.

Sources: Liang, Zeger, Biometrika 73 (1986) 13; Bell, McCaffrey, Survey Methodology 28 (2002) 169 (CR3, Satterthwaite);
MacKinnon, Nielsen, Webb, Journal of Applied Econometrics 38 (2023) 671 (the jackknife where clusters differ);
Pustejovsky, Tipton, Journal of Business & Economic Statistics 36 (2018) 672 (nuisances may be projected out first);
Tipton, Psychological Methods 20 (2015) 375 (4 degrees of freedom); Carlstein, Annals of Statistics 14 (1986) 1171
(blocks); Ljung, Box, Biometrika 65 (1978) 297; Satterthwaite, Biometrics Bulletin 2 (1946) 110 (sums of squares).

Collinearity, which parameters the data distinguish and which only in combination: columns are scaled to unit length,
and the index of a set K is gamma_K = 1 / sqrt(smallest eigenvalue of S_K^T S_K) (Brun, Reichert, Kuensch, Water
Resources Research 37 (2001) 1015, eq. 10). Above 10 to 15 the others compensate a change of one parameter to within
1 / gamma. It does not depend on the noise, so it explains a wide interval and is no criterion by itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import matmul_toeplitz
from scipy.special import chdtrc, chdtri, stdtrit

from shipid.data.dataset import Array
from shipid.document import short_names
from shipid.errors import ShipidError
from shipid.units import join_names, significant_digits

MOST_COLLINEAR = 15.0  # Brun et al.: "critical" from 10 to 15 on
UNSEEN = 1e-10  # of the largest eigenvalue, with columns of unit length: below it no data, only rounding


@dataclass(frozen=True)
class Combination:
    """A set of parameters of which the data determine only a combination.

    names : short ones. weights : relative change of each factor along the direction that leaves the residuals
    unchanged;
    the largest is 1. gamma : collinearity index; infinite for a parameter without any effect.
    """

    paths: tuple[str, ...]
    names: tuple[str, ...]
    weights: tuple[float, ...]
    gamma: float

    def sentence(self) -> str:
        """One sentence that names the parameters and the unidentified direction."""
        if len(self.names) == 1:
            return f"{self.names[0]} has no effect on these data"
        moves = [
            f"{significant_digits(10 * w, 2, '+')} % of {name}"
            for w, name in zip(self.weights, self.names, strict=True)
        ]
        return f"only {join_names(self.names)} together; {' with '.join(moves)} has no effect on these data"


def collinear_sets(jacobian: Array, paths: Sequence[str]) -> tuple[Combination, ...]:
    """Smallest sets with a collinearity index above `MOST_COLLINEAR`; worst first.

    Backward elimination; the parameter of greatest weight of a set is then excluded, and the search is repeated.
    """
    lengths = np.sqrt((jacobian**2).sum(axis=0))
    silent = np.flatnonzero(lengths <= UNSEEN * lengths.max(initial=0.0)).tolist()
    names = short_names(paths)
    result = [Combination((paths[j],), (names[j],), (1.0,), float("inf")) for j in silent]
    scaled = jacobian / np.where(lengths > 0, lengths, 1.0)
    gram, left = np.asarray(scaled.T @ scaled), [j for j in range(len(paths)) if j not in silent]
    while len(left) > 1 and _collinearity_index(gram, left)[0] > MOST_COLLINEAR:
        chosen = _shrink_set(gram, left)
        gamma, direction = _collinearity_index(gram, chosen)
        weights = direction / lengths[chosen]
        weights = weights / weights[np.argmax(np.abs(weights))]
        labels = tuple(paths[j] for j in chosen), tuple(names[j] for j in chosen)
        result.append(Combination(*labels, tuple(map(float, weights)), gamma))
        left.remove(chosen[int(np.argmax(np.abs(direction)))])
    return tuple(result)


def _shrink_set(gram: Array, members: list[int]) -> list[int]:
    while len(members) > 2:
        without = [[smaller for smaller in members if smaller != gone] for gone in members]
        gammas = [_collinearity_index(gram, smaller)[0] for smaller in without]
        best = int(np.argmax(gammas))
        if gammas[best] <= MOST_COLLINEAR:
            break
        members = without[best]
    return members


def _collinearity_index(gram: Array, members: list[int]) -> tuple[float, Array]:
    """The index, and the unit vector of the smallest eigenvalue of the scaled Gram matrix, of the least effect."""
    values, vectors = np.linalg.eigh(gram[np.ix_(members, members)])
    return float(1 / np.sqrt(max(float(values[0]), UNSEEN))), np.asarray(vectors[:, 0])


def invert_information(information: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Pseudo-inverse (n, n) of an information matrix, and a mask (n,) of parameters along its null directions."""
    scale = np.sqrt(np.diag(information))
    scale = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh(information / np.outer(scale, scale))
    silent = values <= UNSEEN * max(float(values[-1]), UNSEEN)
    kept = vectors[:, ~silent]
    inverse = (kept / values[~silent]) @ kept.T / np.outer(scale, scale)
    return inverse, np.asarray((np.abs(vectors[:, silent]) > np.sqrt(UNSEEN)).any(axis=1))


Kind = Literal["fisher", "sandwich", "blocks"]
_Part = tuple[Array, Array, Array]  # of a cluster: singular values of J_g R, those of A_g J_g R, directions (k, n)
KINDS: tuple[Kind, ...] = get_args(Kind)
"""In order of preference: the first trusted form is reported.

If none is trusted it is `block_clusters`, or `fisher_covariance` with one block only.
"""

LEVEL = 0.95  # of intervals
WIDEST = 1.0  # half-width of the 95 % interval of a factor, in base values, from which on it is not identified
LEAST_FREEDOM = 4.0  # degrees of freedom under which t misleads (Tipton 2015)
WHITE = 0.05  # probability under which whiteness is rejected
LITTLE = 1.1  # integrated correlation time, in samples, that makes no difference: 5 % of a standard error
MOST_LAGS, LEAST_ROWS = 10, 5  # lags that whiteness looks at; fewest rows of a run for that
QUARTERS = 4  # stretches of a run whose means show what is too slow and too weak for these lags
OPEN = 1.5**0.5  # errors over stated ones, from which on a warning names the factor: 95 % intervals hold 89 %
ALONE = 0.95  # of the variance of a factor under independent errors: one run decides it
BLOCK = 10.0  # length of a block in integrated correlation times
CONTRARY = 3.0  # standard deviations between a prior and the data that are no chance
KEPT = 1e-4  # of I - H: directions that a cluster alone decides have no residual left


@dataclass(frozen=True)
class LinearFit:
    """Linearisation of a fit at its estimate, as plain arrays; m residuals, n parameters.

    paths, factors : name and estimate (n,) of each factor on the base values; the name of a tied group is its first
    path. centre : (n,) of the base: 0 where that is 0.
    residuals : (m,) predicted less measured over the declared standard deviation, nuisances projected out; by run, then
    time. With huber those of `ResidualPrediction.marginal`.
    jacobian : (m, n) d residual / d factor with the nuisances projected out: J^T J is the Fisher information.
    clusters, signals : (m,) number of the run and column of each residual.
    prior_widths : (n,) standard deviation of each factor's prior; infinite without one.
    spent : (m,) share of each residual that the nuisances have taken (its leverage); 0 without nuisances.
    at_bound : (n,) estimates at a bound. held : (n,) factors that were not free. Neither has an interval.
    dropped : paths of held factors that the drop test removed. runs : name of each run number.
    sizes : value [SI] of the parameter at each factor of 1, or of a current of all runs [m/s], and its unit, (n,).
    """

    paths: tuple[str, ...]
    factors: Array
    residuals: Array
    jacobian: Array
    clusters: NDArray[np.intp]
    signals: tuple[str, ...]
    prior_widths: Array
    spent: Array
    at_bound: NDArray[np.bool_]
    held: NDArray[np.bool_]
    dropped: tuple[str, ...]
    runs: tuple[str, ...]
    centre: Array
    sizes: tuple[tuple[float, str], ...]

    @property
    def free(self) -> NDArray[np.intp]:
        """Places of the factors that are neither held nor at a bound."""
        return np.flatnonzero(~(self.at_bound | self.held))


@dataclass(frozen=True)
class Whiteness:
    """Autocorrelation of the residuals of one signal.

    probability : p-value of whiteness, by Ljung-Box over short lags and by the means over quarters of runs.
    memory : integrated correlation time in samples, 1 for white residuals. samples : number of residuals.
    level : standard deviation over the declared one. freedom : degrees of freedom of that level.
    hidden : variance of means over quarters of runs that a drift may add unseen, over that which white errors give.
    """

    probability: float
    memory: float
    samples: int
    level: float
    freedom: float
    hidden: float = 0.0

    @property
    def effective(self) -> float:
        """Effective number of independent samples."""
        return self.samples / max(self.memory, 1.0)

    @property
    def white(self) -> bool:
        """Whether the autocorrelation is not significant, or negligible."""
        return self.probability >= WHITE or self.memory <= LITTLE


@dataclass(frozen=True)
class Covariance:
    """One form of covariance: matrix (n, n) of the factors, degrees of freedom (n,), whether to trust it, and why.

    clusters : number of runs or stretches that count as independent; 0 for the Fisher form, which has none.
    """

    kind: Kind
    matrix: Array
    freedom: Array
    trusted: bool
    reason: str
    clusters: int = 0

    @property
    def errors(self) -> Array:
        """Standard errors (n,)."""
        return np.sqrt(np.diag(self.matrix))

    @property
    def half_widths(self) -> Array:
        """Half-widths (n,) of the 95 % intervals."""
        return np.asarray(self.errors * stdtrit(self.freedom, 0.5 + LEVEL / 2))


@dataclass(frozen=True)
class Statistics:
    """Uncertainty of the n factors; infinite for factors that the data do not determine.

    inner : the fit of the factors that are neither held nor at a bound alone, with its `basis`. by_data : their
    estimates without the priors.
    chosen : form of covariance to report. errors : (n,) standard errors. low, high : (n,) ends of the 95 % intervals.
    alone : (n,) half-widths without the priors. identifiable : (n,) whether that is at most `WIDEST` and neither the
    interval without the priors nor the one with them holds 0, no effect.
    sentences : the result in words, one for each factor. correlations : (n, n). combinations : sets of free factors
    that the data do not distinguish.
    """

    fit: LinearFit
    inner: LinearFit
    basis: Basis
    by_data: Array
    covariances: Mapping[Kind, Covariance]
    chosen: Kind
    errors: Array
    low: Array
    high: Array
    alone: Array
    correlations: Array
    identifiable: NDArray[np.bool_]
    sentences: tuple[str, ...]
    combinations: tuple[Combination, ...]
    whiteness: Mapping[str, Whiteness]

    @property
    def free(self) -> tuple[str, ...]:
        """Paths of the factors that are neither held nor at a bound."""
        return self.inner.paths

    @property
    def information(self) -> Array:
        """Fisher information (n, n) of the factors with the levels that the residuals show, priors not counted."""
        levels = np.array([self.whiteness[name].level for name in self.fit.signals])
        scaled = self.fit.jacobian / levels[:, None]
        return np.asarray(scaled.T @ scaled)


def fit_statistics(fit: LinearFit) -> Statistics:
    """Covariances, 95 % intervals and identifiability of a fit, linear at the estimate.

    A factor is identified if its 95 % interval from the data alone is within +-`WIDEST` base values, and excludes no
    effect (0) with and without the priors; collinearity explains a wider one. The profile likelihood
    (`shipid.identification.profile`) shows whether that is finite.

    Raises ShipidError for no free factor, fewer residuals than factors, or a prediction that diverges.
    """
    free, n = fit.free, len(fit.paths)
    if not len(free):
        raise ShipidError(_no_estimate_reason(fit))
    if not (np.isfinite(fit.residuals).all() and np.isfinite(fit.jacobian).all()):
        raise ShipidError("residuals and sensitivities must be finite: the prediction diverges at the estimate")
    if len(fit.residuals) <= n:
        raise ShipidError(
            f"{len(fit.residuals)} residuals are too few to estimate the errors of {n} parameters: use more data"
        )
    inner = restrict_fit(fit, free)
    basis = Basis.of(inner)
    colours = residual_whiteness(inner, basis)
    covariances = _covariance_forms(inner, basis, colours)
    chosen: Kind = next((kind for kind in KINDS if kind in covariances and covariances[kind].trusted), "blocks")
    if not covariances[chosen].trusted and covariances[chosen].clusters == 1:
        chosen = "fisher"  # the scores of one block sum to 0
    best = covariances[chosen]
    vague = basis.unseen & ~np.isfinite(inner.prior_widths)
    half, errors = np.where(vague, np.inf, best.half_widths), np.where(vague, np.inf, best.errors)
    by_data, alone = inner.factors, half
    if np.isfinite(inner.prior_widths).any():
        seen = fit_statistics(_by_data_alone(inner))
        by_data, alone = seen.fit.factors, (seen.high - seen.low) / 2
    together = collinear_sets(inner.jacobian, inner.paths)
    wide = np.full((3, n), np.inf)
    wide[:, free] = errors, half, alone
    identifiable = np.zeros(n, dtype=bool)
    identifiable[free] = (alone <= WIDEST) & (np.abs(by_data) > alone) & (np.abs(inner.factors) > half)
    correlations = np.eye(n)
    scale = np.where(best.errors > 0, best.errors, 1.0)
    correlations[np.ix_(free, free)] = best.matrix / np.outer(scale, scale)
    np.fill_diagonal(correlations, 1.0)
    return Statistics(
        fit=fit,
        inner=inner,
        basis=basis,
        by_data=by_data,
        covariances=covariances,
        chosen=chosen,
        errors=wide[0],
        low=fit.factors - wide[1],
        high=fit.factors + wide[1],
        alone=wide[2],
        correlations=correlations,
        identifiable=identifiable,
        sentences=_factor_sentences(fit, wide[1], wide[2], identifiable, together),
        combinations=together,
        whiteness=colours,
    )


def _no_estimate_reason(fit: LinearFit) -> str:
    remedy = "give a smaller drop, or runs that excite them more"
    if not fit.dropped:
        return "every parameter is at a bound or fixed: free more parameters, or widen bounds"
    if len(fit.dropped) == len(fit.paths):
        return f"every parameter was dropped, because the data do not support a change of any: {remedy}"
    return f"every parameter is at a bound, fixed or dropped: {remedy}, or widen bounds"


def restrict_fit(fit: LinearFit, free: NDArray[np.intp]) -> LinearFit:
    """The fit of some of its factors."""
    of_factor = {name: getattr(fit, name)[free] for name in ("factors", "prior_widths", "at_bound", "held", "centre")}
    paths, sizes = tuple(fit.paths[j] for j in free), tuple(fit.sizes[j] for j in free)
    return replace(fit, paths=paths, sizes=sizes, jacobian=fit.jacobian[:, free], **of_factor)


@dataclass(frozen=True)
class Basis:
    """A = J^T J + Lambda, inverted with columns scaled to unit length.

    inverse : (n, n), 0 along the null directions of A. prior : (n,) precisions of the priors.
    leverage : (m,) diagonal of J A^-1 J^T. unseen : (n,) parameters with a component along a null direction.
    """

    inverse: Array
    prior: Array
    leverage: Array
    unseen: NDArray[np.bool_]

    @classmethod
    def of(cls, fit: LinearFit) -> Basis:
        """The basis of all factors of a fit."""
        prior = 1 / fit.prior_widths**2
        inverse, unseen = invert_information(fit.jacobian.T @ fit.jacobian + np.diag(prior))
        leverage = np.einsum("mi,ij,mj->m", fit.jacobian, inverse, fit.jacobian)
        return cls(inverse, prior, leverage, unseen)

    @classmethod
    def of_none(cls, fit: LinearFit) -> Basis:
        """The basis of a fit all of whose factors are known."""
        m, n = fit.jacobian.shape
        return cls(np.zeros((n, n)), np.zeros(n), np.zeros(m), np.zeros(n, dtype=bool))


def residual_whiteness(fit: LinearFit, basis: Basis) -> dict[str, Whiteness]:
    """Autocorrelation and level of the residuals of each signal."""
    taken, labels, result = basis.leverage + fit.spent, np.array(fit.signals), {}
    for name in dict.fromkeys(fit.signals):
        selected = labels == name
        freedom = max(float(selected.sum() - taken[selected].sum()), 1.0)
        level = float(np.sqrt((fit.residuals[selected] ** 2).sum() / freedom))
        runs = runs_of_signal(fit, name)
        drift = _signal_drift(fit, runs, basis)
        probability, memory = _correlation_of_runs([fit.residuals[run] for run in runs], drift)
        result[name] = Whiteness(probability, memory, int(selected.sum()), level, freedom, drift.hidden)
    return result


def runs_of_signal(fit: LinearFit, name: str) -> list[NDArray[np.intp]]:
    """Rows of the residuals of a signal in each run that has some."""
    selected = np.array(fit.signals) == name
    return [np.flatnonzero(selected & (fit.clusters == run)) for run in np.unique(fit.clusters[selected])]


def _correlation_of_runs(runs: Sequence[Array], drift: _Drift) -> tuple[float, float]:
    """Probability that residuals are white, and their integrated correlation time (samples).

    Twice the smaller one of Ljung-Box, the statistics of runs added, and `drift`. The time is 1 + 2 sum rho_k over the
    pooled correlations up to the first pair that is no longer positive (Geyer, Statistical Science 7 (1992) 473); where
    the drift alone shows, at least its ratio.
    """
    statistic, freedom = 0.0, 0
    for run in runs:
        size, lagged = len(run), _autocovariance_sums(run)
        if size < LEAST_ROWS or lagged[0] == 0:
            continue
        lags = np.arange(1, min(MOST_LAGS, size // 5) + 1)
        statistic += size * (size + 2) * float(((lagged[lags] / float(run @ run)) ** 2 / (size - lags)).sum())
        freedom += len(lags)
    if freedom == 0:
        return 1.0, 1.0
    rho = pooled_autocorrelation(runs)
    sums = rho[1:-1:2] + rho[2::2]
    until = int(np.argmax(sums <= 0)) if (sums <= 0).any() else len(sums)
    fast, memory = float(chdtrc(freedom, statistic)), float(max(1 + 2 * sums[:until].sum(), 1.0))
    slow = drift.probability
    return min(2 * min(fast, slow), 1.0), max(memory, drift.ratio) if slow < WHITE / 2 <= fast else memory


@dataclass(frozen=True)
class _Drift:
    """What the means over quarters of runs of one signal show that white errors would not.

    z = Q e has the covariance C = Q (I - H) Q^T under white errors, H = J A^-1 J^T; z^T z has the mean tr C and the
    variance 2 tr C^2, and is judged as chi squared, with Satterthwaite's degrees of freedom. A drift that adds x to the
    variance of the means of errors adds x tr C^2.

    probability : of means as large as these, or larger, under white errors.
    ratio : variance of a mean of errors over that of white ones, 1 + 2 sum (1 - k / n) rho_k for n rows.
    hidden : what a drift adds to this ratio if every second fit overlooks it.
    """

    probability: float = 1.0
    ratio: float = 1.0
    hidden: float = 0.0


def _run_quarters(run: NDArray[np.intp]) -> list[NDArray[np.intp]]:
    """Rows of each quarter of a run of one signal; none if it is too short."""
    return np.array_split(run, QUARTERS) if len(run) >= QUARTERS * LEAST_ROWS else []


def _signal_drift(fit: LinearFit, runs: Sequence[NDArray[np.intp]], basis: Basis) -> _Drift:
    """The means of one signal; runs : rows of each. So a small drift counts that no single correlation shows."""
    total, means = 0.0, []
    for run in runs:
        square = float(fit.residuals[run] @ fit.residuals[run])
        left = len(run) - float(basis.leverage[run].sum())
        for part in _run_quarters(run) if square > 0 else []:
            total += float(fit.residuals[part].sum()) ** 2 / len(part) * max(left, 1.0) / square
            means.append(fit.jacobian[part].sum(axis=0) / len(part) ** 0.5)
    if not means:
        return _Drift()
    taken = basis.inverse @ (np.transpose(means) @ np.array(means))
    once, twice = float(np.trace(taken)), float(np.sum(taken * taken.T))
    expected, squares = max(len(means) - once, KEPT), max(len(means) - 2 * once + twice, KEPT**2)
    freedom = expected**2 / squares
    return _Drift(
        float(chdtrc(freedom, total * expected / squares)),
        1 + (total - expected) / squares,
        float(chdtri(freedom, WHITE / 2) / freedom - 1) * expected / squares,
    )


def pooled_autocorrelation(runs: Sequence[Array]) -> Array:
    """Autocorrelation (longest run,) of the residuals at lags 0, 1, ... samples, pooled over runs; 1 at lag 0."""
    longest = max(len(run) for run in runs)
    products, pairs = np.zeros(longest), np.zeros(longest)
    for run in runs:
        size, lagged = len(run), _autocovariance_sums(run)
        if size >= LEAST_ROWS and lagged[0] > 0:
            products[:size] += lagged
            pairs[:size] += size - np.arange(size)
    if not pairs[0]:
        return np.ones(1)
    return np.asarray(products / np.maximum(pairs, 1) / (products[0] / pairs[0]))


def _autocovariance_sums(run: Array) -> Array:
    """Autocovariance sums (N,): sum over i of run[i] run[i + lag], for lags 0 to N - 1."""
    size = len(run)
    return np.asarray(np.fft.irfft(np.abs(np.fft.rfft(run, 2 * size)) ** 2)[:size]) if run.any() else np.zeros(size)


def _covariance_forms(fit: LinearFit, basis: Basis, colours: Mapping[str, Whiteness]) -> dict[Kind, Covariance]:
    """The Fisher and sandwich forms, and the block form if neither is trusted."""
    colours = _effective_whiteness(fit, basis, colours)
    result: dict[Kind, Covariance] = {"fisher": fisher_covariance(fit, basis, colours)}
    result["sandwich"] = sandwich_covariance(fit, basis, fit.clusters, "sandwich", "runs")
    if not any(covariance.trusted for covariance in result.values()):
        length = BLOCK * max(colour.memory for colour in colours.values())
        clusters, what = block_clusters(fit, length), f"stretches of {length:.0f} samples"
        if len(np.unique(clusters)) == len(np.unique(fit.clusters)):
            what = f"runs, too short to be cut into {what}"
        result["blocks"] = sandwich_covariance(fit, basis, clusters, "blocks", what)
    return result


def _effective_whiteness(fit: LinearFit, basis: Basis, colours: Mapping[str, Whiteness]) -> dict[str, Whiteness]:
    """Whiteness by signal; white where its correlation changes no standard error, as the yaw rate of straight runs."""
    labels, effect = np.array(fit.signals), (fit.jacobian @ basis.inverse) ** 2
    parts = {name: colour.level**2 * effect[labels == name].sum(axis=0) for name, colour in colours.items()}
    most = (LITTLE - 1) * np.sum(list(parts.values()), axis=0)
    return {
        name: colour
        if colour.white or np.any(parts[name] * (colour.memory - 1) > most)
        else replace(colour, probability=1.0, memory=1.0)
        for name, colour in colours.items()
    }


def fisher_covariance(fit: LinearFit, basis: Basis, colours: Mapping[str, Whiteness]) -> Covariance:
    """Covariance for errors of each signal that have one level, and are correlated in time as its residuals are."""
    labels = np.array(fit.signals)
    parts, freedoms = [], []
    for name, colour in colours.items():
        part, freedom = _of_signal(fit, basis, labels == name, colour)
        parts.append(part)
        freedoms.append(freedom)
    matrix = sum(parts) + (basis.inverse * basis.prior) @ basis.inverse
    total = np.diag(matrix)
    squares = sum(np.diag(part) ** 2 / freedom for part, freedom in zip(parts, freedoms, strict=True))
    coloured = [name for name, colour in colours.items() if not colour.white]
    reason = "residuals are white" if not coloured else f"residuals of {', '.join(coloured)} are correlated in time"
    reason += "; the errors count as a first-order process" * bool(coloured)
    return Covariance("fisher", matrix, _satterthwaite_freedom(total, np.asarray(squares)), not coloured, reason)


def _of_signal(fit: LinearFit, basis: Basis, rows: NDArray[np.bool_], colour: Whiteness) -> tuple[Array, float]:
    """Covariance (n, n) that the errors of one signal make, and the degrees of freedom of their level.

    Errors k samples apart have the correlation a^k of a first-order process with the integrated correlation time of the
    residuals, R. With H = J A^-1 J^T the residuals have the mean square s^2 tr(R - H R), so the level s is larger than
    theirs, and (tr (R - H R))^2 / tr (R - H R)^2 degrees of freedom.
    """
    jacobian, a = fit.jacobian[rows], 0.0 if colour.white else (colour.memory - 1) / (colour.memory + 1)
    runs = [np.flatnonzero(fit.clusters[rows] == run) for run in np.unique(fit.clusters[rows])]
    smooth, power = jacobian.copy(), 0.0
    for run in runs if a else []:
        smooth[run] = matmul_toeplitz(a ** np.arange(len(run)), jacobian[run])
        power += float(len(run) + 2 * (a ** (2 * np.arange(1, len(run)))) @ np.arange(len(run) - 1, 0, -1))
    taken = basis.inverse @ (jacobian.T @ smooth)
    left = max(colour.freedom + float(np.sum(jacobian @ basis.inverse * jacobian) - np.trace(taken)), 1.0)
    squares = power - 2 * float(np.sum((smooth @ basis.inverse) * smooth)) + float(np.sum(taken * taken.T))
    freedom = max(left**2 / squares, 1.0) if a and squares > 0 else colour.freedom
    level = colour.level**2 * colour.freedom / left
    return level * (basis.inverse @ jacobian.T @ smooth @ basis.inverse), freedom


def against_priors(judged: Statistics) -> dict[str, tuple[float, float, float]]:
    """Factors whose prior the data contradict: path -> width of the prior, and factor with half-width of data alone.

    By one step of Gauss-Newton without priors: `CONTRARY` standard deviations of prior and data from the centre.
    """
    inner, half = judged.inner, judged.alone[judged.fit.free]
    errors = half / stdtrit(np.inf, 0.5 + LEVEL / 2)
    far = np.abs(judged.by_data - inner.centre) > CONTRARY * np.hypot(inner.prior_widths, errors)
    return {
        inner.paths[j]: (float(inner.prior_widths[j]), float(judged.by_data[j]), float(half[j]))
        for j in np.flatnonzero(far)
    }


def factors_of_single_runs(judged: Statistics) -> dict[str, str]:
    """Factors that one run of several decides alone: path -> name of the run. Others do not show their errors."""
    fit, numbers = judged.inner, np.unique(judged.fit.clusters)
    effect = (fit.jacobian @ judged.basis.inverse) ** 2
    parts = np.array([effect[fit.clusters == number].sum(axis=0) for number in numbers])
    alone = (parts.max(axis=0) > ALONE * parts.sum(axis=0)) & (len(numbers) > 1)
    return {fit.paths[j]: fit.runs[numbers[parts[:, j].argmax()]] for j in np.flatnonzero(alone)}


def open_to_drift(judged: Statistics) -> dict[str, float]:
    """Factors whose interval a slow drift may mislead that the residuals do not show: path -> errors over stated ones.

    It is the drift that half of such fits overlook (`Whiteness.hidden`).
    """
    inner, added = judged.inner, np.zeros(len(judged.free))
    effect = inner.jacobian @ judged.basis.inverse
    for name, colour in judged.whiteness.items():
        quarters = [part for run in runs_of_signal(inner, name) for part in _run_quarters(run)]
        means = [effect[part].sum(axis=0) / len(part) ** 0.5 for part in quarters]
        added += colour.level**2 * colour.hidden * np.square(means).sum(axis=0)
    stated = judged.covariances["fisher"].errors ** 2
    times = np.sqrt(1 + added / np.where(stated > 0, stated, np.inf))
    return {path: float(times[j]) for j, path in enumerate(inner.paths) if times[j] > OPEN}


def _satterthwaite_freedom(total: Array, squares: Array) -> Array:
    """Satterthwaite: total^2 / sum(part^2 / its freedom); infinite where a variance is known exactly."""
    return np.asarray(np.where(squares > 0, total**2 / np.where(squares > 0, squares, 1.0), 1e9))


def sandwich_covariance(fit: LinearFit, basis: Basis, clusters: NDArray[np.intp], kind: Kind, what: str) -> Covariance:
    """Cluster-robust covariance by the jackknife (CR3) with Satterthwaite's degrees of freedom."""
    root, parts, scores = _matrix_root(basis.inverse), [], []
    for number in np.unique(clusters):
        rows = clusters == number
        # H_gg = left values^2 left^T
        left, values, axes = np.linalg.svd(fit.jacobian[rows] @ root, full_matrices=False)
        rest = 1 - values**2
        grown = np.where(rest > KEPT, values / np.maximum(rest, KEPT), 0.0)
        parts.append((values, grown, axes))
        scores.append((grown * (left.T @ fit.residuals[rows])) @ axes)  # root^T J_g^T A_g e_g
    scale, alone = _jackknife_scale(parts, np.array(scores))
    influences = np.array(scores) @ root.T * scale  # change of the estimate without each cluster
    spread_of_data = influences.T @ influences + root @ alone @ root.T
    of_prior = (basis.inverse * basis.prior) @ basis.inverse
    matrix = spread_of_data + of_prior
    free = np.array([_freedom_of_scores(parts, row) for row in root])
    freedom = np.maximum(_satterthwaite_freedom(np.diag(matrix), np.diag(spread_of_data) ** 2 / free), 1.0)
    by_data = np.diag(spread_of_data) >= np.diag(of_prior)  # a prior has any number of degrees of freedom
    typical = float(np.median(freedom[by_data] if by_data.any() else freedom))
    trusted = bool(typical >= LEAST_FREEDOM)
    reason = f"{len(parts)} {what}, worth {typical:.1f} degrees of freedom"
    if not trusted:
        reason += f"; under {LEAST_FREEDOM:g} the intervals mislead"
    return Covariance(kind, matrix, freedom, trusted, reason, len(parts))


def _matrix_root(matrix: Array) -> Array:
    """R with R R^T = matrix, of a positive semidefinite matrix whose scales differ."""
    scale = np.sqrt(np.diag(matrix))
    scale = np.where(scale > 0, scale, 1.0)
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.sqrt(np.maximum(values, 0.0)))


def _jackknife_scale(parts: Sequence[_Part], scores: Array) -> tuple[float, Array]:
    """What to multiply scores (clusters, n) by, and the covariance (n, n) along directions that one cluster decides.

    The scale makes squared scores of independent errors and their variance agree in the median of principal directions.
    Along directions that one cluster alone decides errors count as many times more as the scores of all others do.
    """
    of_scores = sum((axes.T * (values * grown)) @ axes for values, grown, axes in parts)
    of_errors = sum((axes.T * values**2) @ axes for values, _, axes in parts)
    sizes, directions = np.linalg.eigh(of_scores)
    true = np.maximum(np.einsum("in,ij,jn->n", directions, of_errors, directions), 0.0)
    several = sizes > np.maximum(true / 2, KEPT**2)  # at least `true`, or next to nothing
    alone = directions[:, ~several] * np.sqrt(true[~several])
    if not several.any():
        return 1.0, np.asarray(alone @ alone.T)
    level = float((((scores @ directions) ** 2).sum(axis=0)[several] / sizes[several]).mean())
    return float(np.sqrt(np.median(true[several] / sizes[several]))), np.asarray(level * alone @ alone.T)


def _freedom_of_scores(parts: Sequence[_Part], weights: Array) -> float:
    """(tr B)^2 / tr(B^2) of a sum of squared scores along weights (n,), of CR2: A_g = (I - H_gg)^(-1/2)."""
    of_cluster = [(np.sqrt(values * grown) * (axes @ weights), values, axes) for values, grown, axes in parts]
    diagonal = np.array([one @ one for one, _, _ in of_cluster])
    if diagonal.sum() <= KEPT * float(weights @ weights):
        return 1.0  # one cluster alone decides it
    shared = np.array([(values * one) @ axes for one, values, axes in of_cluster])  # I - H couples clusters by it
    taken = (shared**2).sum(axis=1)
    squares = float(diagonal @ diagonal - 2 * diagonal @ taken + ((shared.T @ shared) ** 2).sum())
    return float((diagonal.sum() - taken.sum()) ** 2 / squares) if squares > 0 else 1.0


def block_clusters(fit: LinearFit, length: float) -> NDArray[np.intp]:
    """Clusters (m,) of about `length` samples each: runs cut into equal stretches of the same times for all signals."""
    labels, result, count = np.array(fit.signals), np.zeros(len(fit.residuals), dtype=np.intp), 0
    for run in np.unique(fit.clusters):
        most = 1
        for name in dict.fromkeys(fit.signals):
            rows = np.flatnonzero((fit.clusters == run) & (labels == name))
            pieces = max(int(len(rows) / length), 1)
            result[rows] = count + np.arange(len(rows)) * pieces // max(len(rows), 1)
            most = max(most, pieces)
        count += most
    return result


def _by_data_alone(fit: LinearFit) -> LinearFit:
    step = -invert_information(fit.jacobian.T @ fit.jacobian)[0] @ (fit.jacobian.T @ fit.residuals)
    left = fit.residuals + fit.jacobian @ step
    none = np.full(len(step), np.inf)
    return replace(fit, factors=fit.factors + step, residuals=left, prior_widths=none)


def _width_inflation(fit: LinearFit) -> Array:
    """How many times wider the interval of each factor (n,) is than if all other free ones were known."""
    free, times = fit.free, np.ones(len(fit.paths))
    information = fit.jacobian[:, free].T @ fit.jacobian[:, free]
    times[free] = np.sqrt(np.maximum(np.diag(invert_information(information)[0]) * np.diag(information), 1.0))
    return times


def _factor_sentences(
    fit: LinearFit, half: Array, alone: Array, identifiable: NDArray[np.bool_], sets: Sequence[Combination]
) -> tuple[str, ...]:
    shared, sentences = _width_inflation(fit), list[str]()
    for j, (path, name) in enumerate(zip(fit.paths, short_names(fit.paths), strict=True)):
        together = next((combination for combination in sets if path in combination.paths), None)
        size, unit = (100.0, "% of its base value") if fit.centre[j] else fit.sizes[j]
        known = f"{name} is known to +-{significant_digits(abs(size) * half[j], 2)} {unit}"
        if path in fit.dropped:
            sentences.append(f"{name} was dropped, to {fit.factors[j]:.4g}: the data do not support a change")
        elif fit.held[j]:
            sentences.append(f"{name} was held at {fit.factors[j]:.4g}: no interval")
        elif fit.at_bound[j]:
            sentences.append(f"{name} is at its bound, {fit.factors[j]:.4g}: no interval")
        elif identifiable[j] and together is not None:
            others = join_names([other for other in together.names if other != name])
            index = f"collinearity index {together.gamma:.0f}"
            sentences.append(f"{known}, if the model is right: {others} do nearly the same ({index})")
        elif identifiable[j]:
            sentences.append(known)
        elif together is not None:
            sentences.append(f"{name} is not identified: {together.sentence()}")
        elif np.isfinite(alone[j]):
            why = "hardly excited" if alone[j] > WIDEST * shared[j] else "others do a part of the same"
            why = why if alone[j] > WIDEST else "its interval holds 0, no effect"
            sentences.append(f"{name} is not identified: +-{significant_digits(abs(size) * alone[j], 2)} {unit}, {why}")
        else:
            sentences.append(f"{name} is not identified: no independent effect on these data")
    return tuple(sentences)
