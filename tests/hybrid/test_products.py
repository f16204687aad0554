"""Products by NumPy are those of PyTorch, for every layout that the search hands over."""

from __future__ import annotations

import pytest
import torch

from shipid.hybrid import products


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_products_are_sums_of_products(dtype: torch.dtype) -> None:
    generator = torch.Generator().manual_seed(1)
    left, right = (torch.randn(3, 4, 5, generator=generator, dtype=dtype) for _ in range(2))
    expected = torch.einsum("fij,fkj->fik", left, right)
    tight = {"rtol": 1e-5, "atol": 1e-5} if dtype == torch.float32 else {"rtol": 1e-13, "atol": 1e-13}
    torch.testing.assert_close(products.matrix_product(left, right.mT), expected, **tight)
    torch.testing.assert_close(products.matrix_product(left, right.mT.contiguous()), expected, **tight)
    torch.testing.assert_close(
        products.matrix_product(left[0][:, 1:], right[0].mT[1:]), left[0][:, 1:] @ right[0][:, 1:].T, **tight
    )
    torch.testing.assert_close(
        products.matrix_product(left, right[0].mT), torch.einsum("fij,kj->fik", left, right[0]), **tight
    )
    assert products.matrix_product(left, right.mT).dtype == dtype


@pytest.mark.parametrize("by_torch", [False, True])
def test_a_layer_is_the_tanh_of_its_sums(by_torch: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(products, "_tanh_by_torch", lambda: by_torch)
    generator = torch.Generator().manual_seed(3)
    values, weight, offset = (
        torch.randn(*shape, generator=generator, dtype=torch.float64) for shape in ((9, 3), (3, 5), (5,))
    )
    before = [part.clone() for part in (values, weight, offset)]
    expected = torch.tanh(torch.einsum("sd,dm->sm", values, weight) + offset)
    torch.testing.assert_close(products.hidden_layer(values, weight, offset), expected, rtol=1e-13, atol=1e-13)
    assert all(torch.equal(one, other) for one, other in zip(before, (values, weight, offset), strict=True))
