"""States of rest in torch: positions that know how they depend on stiffness.

>>> import torch, viscera as vi, viscera.torch                            # doctest: +SKIP
>>> young = torch.tensor(8e3, dtype=torch.float64, requires_grad=True)    # doctest: +SKIP
>>> x = vi.torch.equilibrium(scene, {"body.liver.material.young": young}) # doctest: +SKIP
>>> x["liver"].square().sum().backward()                                  # doctest: +SKIP

Gradients are exact, by one adjoint solve a time; there are none of second order. Needs PyTorch; states of rest are
computed on the CPU in double precision, wherever parameters lie.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ._errors import SceneError
from ._types import Floats
from ._viscera import Rest, Scene, rest

try:
    import torch
except ImportError:
    raise ImportError("viscera.torch needs PyTorch: pip install 'viscera[torch]'") from None


class _Equilibrium(torch.autograd.Function):  # type: ignore[misc, unused-ignore]
    @staticmethod
    def forward(
        ctx: Any, scene: Scene, times: Any, keys: tuple[str, ...], kept: list[Rest], *values: Any
    ) -> Any:
        """Positions of all bodies, one after another."""
        changed = scene.copy()
        changed.update({key: float(value) for key, value in zip(keys, values, strict=True)})
        near = kept[0] if kept else None
        state = rest(changed, times, unknown=keys, near=near)
        kept[:] = [state]
        ctx.state, ctx.bodies, ctx.keys = state, changed.bodies, keys
        ctx.types = [(value.dtype, value.device) for value in values]
        return tuple(torch.from_numpy(state.positions(body)) for body in changed.bodies)

    @staticmethod
    @torch.autograd.function.once_differentiable  # type: ignore[untyped-decorator, unused-ignore]
    def backward(ctx: Any, *gradients: Any) -> Any:
        """The adjoint of all bodies' gradients."""
        by_positions: dict[str, Floats] = {
            body: np.asarray(gradient.detach().cpu(), dtype=np.float64)
            for body, gradient in zip(ctx.bodies, gradients, strict=True)
            if gradient is not None
        }
        pulled = ctx.state.pull_back(by_positions)
        return (
            *(None,) * 4,
            *(
                torch.tensor(pulled[key], dtype=kind, device=device)
                for key, (kind, device) in zip(ctx.keys, ctx.types, strict=True)
            ),
        )


def equilibrium(
    scene: Scene,
    parameters: Mapping[str, Any],
    times: Any = None,
    *,
    near: list[Rest] | None = None,
) -> dict[str, Any]:
    """Positions of each body at rest [m] as tensors of shape (times, vertices, 3), in double precision.

    ``parameters`` has a tensor of one number in SI units for each key, see :func:`viscera.rest`; gradients go to those
    that ask for them. ``near``, a list that is kept between calls, makes searches begin where the last one ended.
    """
    keys = tuple(parameters)
    values = [torch.as_tensor(parameters[key]) for key in keys]
    for key, value in zip(keys, values, strict=True):
        if value.dim() != 0 or value.is_complex():
            raise SceneError(
                f"{key}: give a tensor of one number, torch.tensor(5e3); this has shape {tuple(value.shape)}"
            )
    kept: list[Rest] = [] if near is None else near
    positions = _Equilibrium.apply(scene, times, keys, kept, *values)
    return dict(zip(scene.bodies, positions, strict=True))
