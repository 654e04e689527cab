"""Torch: arrays without a copy, states of rest with gradients."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
import viscera as vi
from test_rest import POISSON, YOUNG, drawn

torch = pytest.importorskip(
    "torch", reason="PyTorch is not installed: its wheels for Linux are gigabytes"
)
equilibrium = pytest.importorskip("viscera.torch").equilibrium


def test_positions_are_shared_with_torch() -> None:
    sim = vi.Simulation(drawn())
    positions = sim["block"].positions
    with pytest.warns(UserWarning, match="not writable"):
        tensor = torch.from_numpy(positions)
    assert tensor.data_ptr() == positions.__array_interface__["data"][0]
    before = tensor.clone()
    sim.advance(10)
    assert not torch.equal(tensor, before)
    np.testing.assert_array_equal(tensor.numpy(), sim["block"].positions)


def test_gradients_are_what_differences_say() -> None:
    scene = drawn()

    def loss(young: Any, poisson: Any) -> Any:
        x = equilibrium(scene, {YOUNG: 1e4 * young, POISSON: poisson}, [0.2, 0.4])["block"]
        return 1e3 * x.square().sum()

    values = [torch.tensor(v, dtype=torch.float64, requires_grad=True) for v in (0.7, 0.43)]
    assert torch.autograd.gradcheck(loss, values, eps=1e-5, atol=1e-7, rtol=1e-5)
    # Single precision asks for single precision.
    single = torch.tensor(7e3, requires_grad=True)
    equilibrium(scene, {YOUNG: single})["block"].sum().backward()
    assert single.grad is not None
    assert single.grad.dtype == torch.float32


def test_a_descent_finds_the_stiffness() -> None:
    scene = drawn(**{"body.block.material.poisson": 0.43})
    truth = torch.from_numpy(vi.rest(drawn(**{YOUNG: 6e3, POISSON: 0.43})).positions("block"))
    log_young = torch.tensor(np.log(12e3), requires_grad=True)
    near: list[vi.Rest] = []
    optimizer = torch.optim.LBFGS(
        [log_young], max_iter=30, tolerance_grad=1e-12, tolerance_change=0.0
    )

    def closure() -> Any:
        optimizer.zero_grad()
        x = equilibrium(scene, {YOUNG: torch.exp(log_young)}, near=near)["block"]
        loss = 1e9 * (x - truth).square().sum()
        loss.backward()
        return loss

    optimizer.step(closure)
    assert float(torch.exp(log_young.detach())) == pytest.approx(6e3, rel=1e-2)
    assert len(near) == 1


def test_what_is_no_number_is_told() -> None:
    with pytest.raises(vi.SceneError, match="one number"):
        equilibrium(drawn(), {YOUNG: torch.ones(3)})
    with pytest.raises(vi.UnknownKeyError):
        equilibrium(drawn(), {"body.blok.material.young": torch.tensor(4e3)})
    x = equilibrium(drawn(), {YOUNG: torch.tensor(8e3)})["block"]
    assert not x.requires_grad
