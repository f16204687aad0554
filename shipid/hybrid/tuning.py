"""Tuning: windows and a recipe in, the best compensator of each model out."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

from shipid.errors import DataError
from shipid.hybrid.compensator import Array, Index, Tuned
from shipid.hybrid.gradient import tune_gradient
from shipid.hybrid.recipe import GradientRecipe, Recipe, RidgeRecipe
from shipid.hybrid.ridge import tune_ridge


def tune(
    columns: Mapping[str, Array],
    commands: Sequence[str],
    targets: Mapping[str, Array],
    folds: Sequence[tuple[Index, Index]],
    recipe: Recipe,
    seed: int,
    *,
    on_trial: Callable[[int, int], None] | None = None,
    device: str = "cpu",
) -> dict[str, Tuned]:
    """Tune a compensator for each model on the same windows, as the recipe says.

    Parameters
    ----------
    columns : quantities (S,) at the instants of prediction, SI and radians.
    commands : names of the command columns.
    targets : model -> (T, S, 2) [m] what its physics misses, or the path itself for pure data-driven.
    folds : (training, validation) indices of windows, split by manoeuvre; one pair, or one per fold.
    recipe : what is searched, and how a network gets its weights.
    seed : of all that is random; a model's result does not depend on its company.
    on_trial : called with (trials done, trials in all) after each trial of all models.
    device : a PyTorch device.

    Raises
    ------
    DataError : a column is missing, or a fold has no windows to train on or to validate with.
    """
    if any(len(part) == 0 for fold in folds for part in fold):
        raise DataError("a fold has no windows to train on or to validate with: use more manoeuvres")
    if isinstance(recipe, RidgeRecipe):
        return tune_ridge(columns, commands, targets, folds, recipe, seed, on_trial=on_trial, device=device)
    assert isinstance(recipe, GradientRecipe)
    return tune_gradient(columns, commands, targets, folds, recipe, seed, on_trial=on_trial, device=device)
