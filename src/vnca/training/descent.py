"""Gradient descent on a rule's weights, with a way back when it diverges."""

from collections.abc import Mapping, Sequence

import torch
from torch import Tensor

from vnca.training import Snapshot, count, matched

PATIENCE = 20
"""So many exploded states in a row are the rule's fault. In training that goes well there are two
at most; a pool hands out its seed several times in so many iterations."""
KEEP_EVERY = 10
"""Iterations between weights that are kept to go back to."""
MOST_ROLLBACKS = 3
"""How often the learning rate is halved before training is given up."""


class Descent:
    """Adam on the weights of a rule.

    Training has diverged when the loss, a gradient or a weight is not finite, or when state after
    state explodes. It then goes back to the last weights it kept, with Adam's moments, and goes
    on from there at half the learning rate. A loss or gradient that is not finite because the
    state exploded says nothing of the weights: that iteration teaches nothing.

    Attributes:
        kept_at: The iteration whose weights it would go back to.
        rollbacks: How often it went back.
    """

    def __init__(self, weights: Sequence[Tensor], rates: Sequence[float] | None = None) -> None:
        """Prepare to change `weights`, in place.

        Args:
            weights: The leaves of the graph.
            rates: What the learning rate is multiplied by for each; 1 unless given.
        """
        self._weights = list(weights)
        self._rates = [1.0] * len(self._weights) if rates is None else list(rates)
        self._adam = torch.optim.Adam([{"params": [weight]} for weight in self._weights])
        self._explosions = 0  # in a row
        self._kept = self._now()
        self.kept_at = 0
        self.rollbacks = 0

    @property
    def is_exhausted(self) -> bool:
        """Whether training diverged once more than it may."""
        return self.rollbacks > MOST_ROLLBACKS

    @property
    def slowdown(self) -> float:
        """What the learning rate is multiplied by after the rollbacks so far."""
        return 0.5**self.rollbacks

    def step(self, loss: Tensor, rate: float, iteration: int, *, exploded: bool) -> bool:
        """One step down the gradient; False if training has diverged and went back instead.

        Args:
            loss: What to minimise.
            rate: The learning rate, before any slowdown.
            iteration: Counted from 1.
            exploded: Whether the rollout left the range.
        """
        has_learned = self._learn(loss, rate * self.slowdown)
        self._explosions = self._explosions + 1 if exploded else 0
        is_sound = all(bool(torch.isfinite(weight).all()) for weight in self._weights)
        if not is_sound or not (has_learned or exploded) or self._explosions >= PATIENCE:
            self._write(self._kept)
            self._explosions = 0
            self.rollbacks += 1
            return False
        if not exploded and iteration % KEEP_EVERY == 0:
            self._kept, self.kept_at = self._now(), iteration
        return True

    def _learn(self, loss: Tensor, rate: float) -> bool:
        """A step of Adam; none where the loss or a gradient is not finite.

        Each gradient gets unit length: rollouts of any length then teach equally much.
        """
        self._adam.zero_grad()
        if not bool(torch.isfinite(loss)):
            return False
        loss.backward()
        gradients = [weight.grad for weight in self._weights if weight.grad is not None]
        norms = [gradient.norm() for gradient in gradients]
        if not all(bool(norm.isfinite()) for norm in norms):
            return False
        for gradient, norm in zip(gradients, norms, strict=True):
            gradient /= norm + 1e-8
        for group, factor in zip(self._adam.param_groups, self._rates, strict=True):
            group["lr"] = rate * factor
        self._adam.step()
        return True

    def snapshot(self) -> Snapshot:
        """Weights, Adam's moments, and both as they were when they were last kept."""
        tensors = {"now." + name: tensor for name, tensor in self._now().items()}
        tensors |= {"kept." + name: tensor for name, tensor in self._kept.items()}
        values = {
            "explosions": self._explosions,
            "kept_at": self.kept_at,
            "rollbacks": self.rollbacks,
        }
        return Snapshot(tensors, values)

    def restore(self, snapshot: Snapshot) -> None:
        """Go on from a snapshot.

        Raises:
            KeyError, TypeError, ValueError: If it is not one of such weights.
        """
        like = self._now()
        now, kept = (
            {name: matched(snapshot.tensors[when + name], own, name) for name, own in like.items()}
            for when in ("now.", "kept.")
        )
        for name, tensor in (*now.items(), *kept.items()):
            if name.endswith(("step", "exp_avg_sq")) and bool((tensor < 0).any()):
                raise ValueError(f"{name}: negative")
        values = snapshot.values
        self._explosions = count(values["explosions"], "explosions", most=PATIENCE)
        self.kept_at = count(values["kept_at"], "kept_at")
        self.rollbacks = count(values["rollbacks"], "rollbacks", most=MOST_ROLLBACKS + 1)
        self._write(now)
        self._kept = kept

    def _now(self) -> dict[str, Tensor]:
        """Copies of the weights and of Adam's moments, zeros before its first step."""
        tensors = {}
        for place, weight in enumerate(self._weights):
            adam = self._adam.state.get(weight, {})
            tensors[f"{place}.weight"] = weight.detach().clone()
            tensors[f"{place}.step"] = adam.get("step", torch.tensor(0.0)).clone()
            for moment in ("exp_avg", "exp_avg_sq"):
                value = adam.get(moment, torch.zeros_like(weight))
                tensors[f"{place}.{moment}"] = value.detach().clone()
        return tensors

    def _write(self, tensors: Mapping[str, Tensor]) -> None:
        for place, weight in enumerate(self._weights):
            with torch.no_grad():
                weight.copy_(tensors[f"{place}.weight"])
            # Adam changes its own in place.
            self._adam.state[weight] = {
                name: tensors[f"{place}.{name}"].clone()
                for name in ("step", "exp_avg", "exp_avg_sq")
            }
