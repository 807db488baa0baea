"""Where states live: a scene with its pool, and what rolls the states out on it."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from vnca.engine import Session
from vnca.training.config import TrainingConfig
from vnca.training.rollout import Pool
from vnca.training.scenes import Scene
from vnca.training.styles import Lessons


@dataclass(eq=False)
class Ground:
    """A scene, and what belongs to its cells alone. A training has one for each frame.

    Attributes:
        scene: What is trained on.
        session: What computes the automaton there; another that does the same may take its place.
        pool: The states.
        lessons: Which styles they are asked for; None of a rule of one.
    """

    scene: Scene[Any]
    session: Session
    pool: Pool
    lessons: Lessons | None

    @classmethod
    def of(
        cls,
        scene: Scene[Any],
        session: Session,
        config: TrainingConfig,
        *,
        styles: int,
        random: np.random.Generator,
    ) -> "Ground":
        """That of a scene, before the first iteration.

        Args:
            scene: What is trained on.
            session: What computes the automaton there.
            config: The hyperparameters.
            styles: How many the rule learns.
            random: What slots of the pool are drawn from.
        """
        return cls(
            scene,
            session,
            Pool(scene.seed(config.rule.channels), config.pool, random),
            Lessons(styles, scene.domain, config.seed) if config.rule.style_columns else None,
        )
