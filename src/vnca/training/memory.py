"""How much memory training takes, for when there is not so much."""

from vnca.training.course import CourseConfig

VIEW_BYTES = 7000
"""A pixel of a view with all that is computed from it. Measured at 128² to 256² pixels, 24³ cells:
5,200 to 6,900 bytes with VGG16 in bfloat16, 7,100 to 9,600 in float32."""


def is_out_of_memory(error: BaseException) -> bool:
    """Whether an allocation failed: torch says so in an error that has no class of its own."""
    told = str(error)
    return isinstance(error, MemoryError) or (
        isinstance(error, RuntimeError)
        and any(
            words in told for words in ("allocate memory", "not enough memory", "out of memory")
        )
    )


def memory_needs(cells: int, config: CourseConfig) -> dict[str, int]:
    """About how many bytes training takes, beside torch and the frame, by the option that rules it.

    Args:
        cells: Cells that live.
        config: The hyperparameters.
    """
    state = cells * config.rule.channels * 4
    return {
        "pool.size": config.pool.size * state,
        "longest-rollout": config.longest_rollout * state,
        config.pictures.option: config.pictures.count * config.pictures.size**2 * VIEW_BYTES,
    }


def memory_advice(cells: int, config: CourseConfig) -> str:
    """What takes how much memory, and what would take less, in one line."""
    needs = memory_needs(cells, config)
    seen = config.pictures
    values = {
        "pool.size": config.pool.size,
        "longest-rollout": config.longest_rollout,
        seen.option: seen.size,
    }
    largest = max(needs, key=lambda option: needs[option])
    least, power = (32, 2) if largest == seen.option else (1, 1)
    lower = max(values[largest] // 2, least)
    less = needs[largest] * (1 - (lower / values[largest]) ** power)
    taken = ", ".join(
        f"--{option} {values[option]} about {_size(bytes_)}" for option, bytes_ in needs.items()
    )
    return (
        f"for {cells} cells training takes {taken}; --{largest} {lower} would take "
        f"{_size(less)} less"
    )


def _size(bytes_: float) -> str:
    return f"{bytes_ / 1e9:.1f} GB" if bytes_ >= 1e9 else f"{bytes_ / 1e6:.0f} MB"
